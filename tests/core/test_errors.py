"""Errors: one tree, distinct exit codes, messages that name the alternatives."""

import pytest

from app.core import errors
from app.core.dialogue import approval
from app.core.errors import DipacError, ParameterError, UsageError
from app.core.system import channel, worker


def subclasses(error: type[DipacError]) -> list[type[DipacError]]:
    return [error, *(deeper for child in error.__subclasses__() for deeper in subclasses(child))]


def test_an_unknown_name_is_answered_with_the_nearest_and_all_known():
    error = UsageError.unknown("task", "rope_pusj", ["rope_push", "bean_sweep"])
    assert str(error) == "Unknown task 'rope_pusj'. Did you mean 'rope_push'? Known: bean_sweep, rope_push."


def test_nothing_is_suggested_where_nothing_is_near():
    assert str(UsageError.unknown("task", "xyz", ["rope_push"])) == "Unknown task 'xyz'. Known: rope_push."


def test_an_empty_choice_says_none():
    assert str(UsageError.unknown("camera", "left", [])) == "Unknown camera 'left'. Known: none."


def test_unknown_makes_the_class_it_is_called_on():
    assert type(ParameterError.unknown("parameter", "mu", ["friction"])) is ParameterError


def test_every_exit_code_is_a_failure_that_a_shell_can_tell_from_a_signal():
    assert {module.__name__ for module in (approval, channel, errors, worker)}  # Their errors are in the tree.
    assert all(1 <= error.exit_code < 126 for error in subclasses(DipacError))


def test_families_of_errors_have_different_exit_codes():
    families = [DipacError, *(child for child in DipacError.__subclasses__() if child.__module__ == errors.__name__)]
    codes = [family.exit_code for family in families]
    assert len(set(codes)) == len(codes)


@pytest.mark.parametrize("error", subclasses(DipacError), ids=lambda error: error.__name__)
def test_every_error_says_when_it_is_raised(error):
    assert error.__doc__
    assert error.__doc__ != Exception.__doc__
