"""Recordings of a drawn rope, drawn beans, a cloth, water or soup, without images.

`python -m bench.hidden.made ORDER.json -o FOLDER`, a process of its own. ORDER.json is {task, world, seed, hidden:
[[effect, size], ...], episodes, pushes}; sizes are in typical ones. With {own: true} beans are the task's, and noise
is that of the cell's cameras. Makes FOLDER/recordings/*.mcap and FOLDER/truth.json, which has the sizes of the object,
too.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.policy.random_carries import carry_design
from app.policy.random_pours import pour_design
from app.policy.random_pushes import PushDesign
from app.policy.random_sweeps import sweep_design
from app.rig.simulated.effect_sampling import describe
from bench.hidden.beans import BeanCase
from bench.hidden.cloths import ClothCase
from bench.hidden.draws import Chosen
from bench.hidden.own_ropes import OwnRope
from bench.hidden.pours import POURED, PourCase
from bench.hidden.recorded import write
from bench.hidden.ropes import USUAL_NOISE_M, RopeCase
from bench.hidden.sizes import FLAT, drawn_cameras


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("order", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    make(json.loads(options.order.read_text(encoding="utf-8")), options.output)


def make(order: Mapping[str, Any], folder: Path) -> None:
    """The recordings of an order, and the truth beside their folder."""
    hidden = tuple(Chosen(effect=name, size=size) for name, size in order["hidden"])
    plan = PushDesign(episodes=order["episodes"], pushes=order["pushes"])
    seed, own_object = order["seed"], bool(order.get("own", False))
    noise_m = USUAL_NOISE_M if own_object else drawn_cameras(seed)[1]
    if order["task"] == "bean_sweep":
        sweeps = sweep_design(plan.episodes, plan.pushes)
        beans = BeanCase(seed=seed, hidden=hidden, plan=sweeps, noise_m=noise_m, other_beans=not own_object)
        task, effects, study = beans.task, describe(beans.injected), beans.record()
    elif order["task"] == "cloth_hang":
        cloth = ClothCase(seed=seed, hidden=hidden, plan=carry_design(plan.episodes, plan.pushes))
        task, effects, study = cloth.task, describe(cloth.injected), cloth.record()
    elif order["task"] in POURED:
        pours = pour_design(plan.episodes, plan.pushes)
        poured = PourCase(seed=seed, of=order["task"], hidden=hidden, plan=pours, noise_m=noise_m)
        task, effects, study = poured.task, describe(poured.injected), poured.record()
    elif order["world"] == "own":
        own = OwnRope(seed=seed, hidden=hidden, plan=plan, flat=FLAT, noise_m=noise_m)
        task, effects, study = own.task, own.world.effects, own.record()
    else:
        other = RopeCase(seed=seed, hidden=hidden, plan=plan, flat=FLAT, noise_m=noise_m)
        task, effects, study = other.task, describe(other.injected), other.record()
    write(study, folder / "recordings")
    truth = {
        "effects": effects,
        "seed": seed,
        "task": task.name,
        "noise_m": noise_m,
        "episodes": plan.episodes,
        "pushes": plan.pushes,
    }
    (folder / "truth.json").write_text(json.dumps(truth), encoding="utf-8")


if __name__ == "__main__":
    main()
