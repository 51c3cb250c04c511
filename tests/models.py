"""Models that tests plan with."""

from dataclasses import replace

from app.core.messages import Model
from app.jobs.worker_api import nominal_model


def model_with(task: str, **values: float) -> Model:
    """The nominal model of a task with other values of these parameters."""
    nominal = nominal_model(task)
    parameters = tuple(replace(each, value=values.get(each.name, each.value)) for each in nominal.parameters)
    return replace(nominal, parameters=parameters)
