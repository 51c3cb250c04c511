"""Pouring a soup, a liquid and what swims in it, from a bowl in the hand into one on the table (paper, Pour-Soup).

What is not said here is as in `pour_water`: bowls, actions, policy, presets. Cubes of fried tofu and of broccoli are
lighter than the broth.
"""

from dataclasses import replace

from app.core.colours import ColourRange
from app.core.geometry.scene_description import Liquid, Pieces, Soup
from app.perception.body.floating_pieces import Swimming
from app.tasks.elements.pouring import pouring_scene
from app.tasks.elements.success import InBowl
from app.tasks.elements.swimming import SoupProblems
from app.tasks.pour_water import HELD, HOME_M, PARTICLES, TARGET
from app.tasks.pour_water import TASK as POUR_WATER

# Drops of the size of the grains that pieces are made of: 4 mm.
BROTH = Liquid(volume_m3=96e-6, colour=(0.75, 0.18, 0.06), drops=1500)
TOFU = Pieces(count=3, edge_m=0.016, density_kg_m3=900.0, young_pa=1e4, colour=(0.92, 0.78, 0.20))
BROCCOLI = Pieces(count=3, edge_m=0.016, density_kg_m3=700.0, young_pa=2e4, colour=(0.15, 0.55, 0.18))
SOUP = Soup(liquid=BROTH, pieces=(TOFU, BROCCOLI))
SWIMMING = Swimming(
    colours=tuple(ColourRange.around(kind.colour) for kind in SOUP.pieces),
    share=SOUP.solid_m3 / SOUP.volume_m3,
    below_m=TOFU.edge_m / 2,
)

TASK = replace(
    POUR_WATER,
    name="pour_soup",
    stage=replace(POUR_WATER.stage, body=SOUP),
    perception=replace(
        POUR_WATER.perception, colour=ColourRange.around(BROTH.colour), volume_m3=SOUP.volume_m3, swimming=SWIMMING
    ),
    scene=pouring_scene(SOUP, HELD, TARGET, particle_count=PARTICLES),
    problems=SoupProblems(soup=SOUP, seen=SWIMMING, held=HELD, target=TARGET, home_m=HOME_M),
    success=InBowl(place_m=TARGET.place_m, radius_m=TARGET.radius_m, least=0.80),
    # A millimetre of its level, by which cameras err, is 7 % of what is poured.
    with_body=None,
    stop_when=InBowl(place_m=TARGET.place_m, radius_m=TARGET.radius_m, least=0.88),
)
