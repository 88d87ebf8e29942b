"""What is painted in a furnished plan: only what is listed, on rectangles, the same every time."""

from __future__ import annotations

import numpy as np

from bsg_data.synthetic.floor_plan import STOREY, draw_floor_plan
from bsg_data.synthetic.furnishing import Fixture, Surface, furnish

TEXEL = 0.02
NAMES = ("floor", "ceiling", "wall", "door", "window", "bed", "picture", "")


def furnished(seed: int) -> tuple[list[Surface], list[Fixture]]:
    rng = np.random.default_rng(seed)
    plan = draw_floor_plan(5, with_stairs={0}, rng=rng)
    fixtures = [
        Fixture(1 + len(NAMES) * room + place, name, room)
        for room in range(5)
        for place, name in enumerate(NAMES)
    ]
    fixtures.append(Fixture(1 + len(fixtures), "stairs", 0))
    return furnish(plan, fixtures, texel=TEXEL, rng=rng), fixtures


def test_only_listed_labels_are_painted_and_every_floor_is() -> None:
    surfaces, fixtures = furnished(0)
    painted = {int(label) for surface in surfaces for label in np.unique(surface.texels)}
    assert {label for label in painted if label > 0} <= {fixture.label for fixture in fixtures}
    assert {fixture.label for fixture in fixtures if fixture.category == "floor"} <= painted


def test_surfaces_are_rectangles_of_whole_texels() -> None:
    for surface in furnished(1)[0]:
        axes = np.stack([surface.across, surface.upward, surface.normal])
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert surface.texels.shape == surface.specks.shape
        rows, columns = surface.texels.shape
        box = surface.box_of(np.ones((rows, columns), dtype=bool), texel=TEXEL)
        sides = sorted(np.subtract(box.maximum, box.minimum))
        np.testing.assert_allclose(sides, [0, *sorted([rows * TEXEL, columns * TEXEL])], atol=1e-9)


def test_stairs_lead_to_the_next_storey() -> None:
    surfaces, fixtures = furnished(2)
    stairs = fixtures[-1].label
    boxes = [
        surface.box_of(surface.texels == stairs, texel=TEXEL)
        for surface in surfaces
        if ((surface.texels == stairs) & ~surface.specks).any()
    ]
    assert max(box.maximum[2] for box in boxes) >= STOREY - TEXEL


def test_the_same_seed_paints_the_same() -> None:
    for one, other in zip(furnished(3)[0], furnished(3)[0], strict=True):
        assert (one.texels == other.texels).all()
        assert (one.corner == other.corner).all()
