"""A long hollow cylinder, heated within and cooled without, against its closed form.

[Boley1960] 9.10, plane strain: T(r) = T_i - (T_i - T_o) ln(r/a) / ln(b/a), and with
I(r) = int_a^r (T - T_cold) r dr, alpha constant,

    u       = (1 + nu)/(1 - nu) alpha/r (I(r) + ((1 - 2 nu) r^2 + a^2)/(b^2 - a^2) I(b))
    sigma_r = alpha E/(1 - nu) 1/r^2 ((r^2 - a^2)/(b^2 - a^2) I(b) - I(r))
    sigma_t = alpha E/(1 - nu) 1/r^2 ((r^2 + a^2)/(b^2 - a^2) I(b) + I(r) - (T - T_cold) r^2)
    sigma_z = nu (sigma_r + sigma_t) - alpha E (T - T_cold)
"""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.physics.mould.hot.conduction import Conduction, FaceLoad
from castfem.physics.mould.hot.copper import Copper
from castfem.physics.mould.hot.distortion import Distortion

from .tubes import COLD, plain_copper, round_tube

A, B = 0.06, 0.08
FLUX, H, K = 2e6, 3e4, 380.0
NU, ALPHA, E = 0.34, 17e-6, 117e9
OUTER = COLD + FLUX * A / (H * B)


def temperature(r: Array) -> Array:
    return np.asarray(OUTER + FLUX * A * np.log(B / r) / K)


def heat(r: Array) -> Array:
    """I(r), integrated by parts."""
    c = FLUX * A / K
    rest = 0.5 * (OUTER - COLD) * (r**2 - A**2)
    return np.asarray(
        rest + c * (0.5 * r**2 * np.log(B / r) - 0.5 * A**2 * np.log(B / A) + 0.25 * (r**2 - A**2))
    )


def displacement(r: Array) -> Array:
    fraction = ((1.0 - 2.0 * NU) * r**2 + A**2) / (B**2 - A**2)
    return np.asarray((1.0 + NU) / (1.0 - NU) * ALPHA / r * (heat(r) + fraction * heat(B)))


def stresses(r: Array) -> Array:
    """Radial, hoop, axial (..., 3)."""
    scale, ring, rise = ALPHA * E / (1.0 - NU) / r**2, B**2 - A**2, temperature(r) - COLD
    radial = scale * ((r**2 - A**2) / ring * heat(B) - heat(r))
    hoop = scale * ((r**2 + A**2) / ring * heat(B) + heat(r) - rise * r**2)
    return np.stack([radial, hoop, NU * (radial + hoop) - ALPHA * E * rise], axis=-1)


def von_mises(r: float) -> float:
    """Von Mises stress of the closed form."""
    radial, hoop, axial = stresses(np.array(r))
    squares = (radial - hoop) ** 2 + (hoop - axial) ** 2 + (axial - radial) ** 2
    return float(np.sqrt(0.5 * squares))


def errors(cells: int) -> tuple[float, float, float]:
    """Largest error of temperature (K), and of displacement and stress over their largest value."""
    tube = round_tube(cells)
    heated = Conduction(tube, plain_copper()).solve(FaceLoad(FLUX, H, COLD))
    r = np.hypot(*tube.scalars.tabulate_dof_coordinates()[:, :2].T)
    off = np.abs(heated.temperature.x.array - temperature(r)).max()
    assert heated.supplied == pytest.approx(heated.removed, rel=1e-9)
    distortion = Distortion(tube, plain_copper(), "between")
    found = distortion.solve(heated.temperature)
    moved = found.displacement.x.array.reshape(-1, 3)
    radial = (moved[:, :2] * tube.scalars.tabulate_dof_coordinates()[:, :2]).sum(axis=1) / r
    exact = displacement(r)
    barlow = 0.5 + 0.5 / np.sqrt(3.0) * np.array([[1, 1, 1], [-1, 1, 1], [1, -1, -1]])
    sigma, places = distortion.stress_at(found.displacement, heated.temperature, barlow)
    across = np.hypot(places[..., 0], places[..., 1])
    unit = places[..., :2] / across[..., None]
    turned = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    cylinder = [
        np.einsum("...i,...ij,...j->...", way, sigma[..., :2, :2], way) for way in (unit, turned)
    ]
    stress = np.stack([*cylinder, sigma[..., 2, 2]], axis=-1)
    wanted = stresses(across)
    return (
        float(off),
        float(np.abs(radial - exact).max() / np.abs(exact).max()),
        float(np.abs(stress - wanted).max() / np.abs(wanted).max()),
    )


def test_order_of_temperature_displacement_and_stress() -> None:
    coarse, fine = np.array(errors(2)), np.array(errors(4))
    order = np.log2(coarse / fine)
    assert fine[0] < 2e-4 and fine[1] < 1e-5 and fine[2] < 2e-3
    assert order[0] > 3.0 and order[1] > 3.0 and order[2] > 1.9


@pytest.mark.parametrize(("cells", "part"), [(1, 0.03), (2, 0.009)])
def test_the_largest_stress_is_that_of_the_hot_face(cells: int, part: float) -> None:
    tube = round_tube(cells)
    warm = tube.function()
    r = np.hypot(*tube.scalars.tabulate_dof_coordinates()[:, :2].T)
    warm.x.array[:] = temperature(r)
    found = Distortion(tube, plain_copper(), "between").solve(warm)
    assert found.largest_stress == pytest.approx(von_mises(A), rel=part)
    assert np.hypot(*found.largest_at[:2]) == pytest.approx(A)
    wanted = np.array([von_mises(float(one)) for one in r])
    assert found.von_mises.x.array == pytest.approx(wanted, abs=2.0 * part * von_mises(A))


def test_closed_form_is_in_equilibrium() -> None:
    """The formulas above, against d(r sigma_r)/dr = sigma_t and traction-free walls."""
    r, step = np.linspace(0.062, 0.078, 9), 1e-6
    slope = ((r + step) * stresses(r + step)[:, 0] - (r - step) * stresses(r - step)[:, 0]) / (
        2.0 * step
    )
    assert slope == pytest.approx(stresses(r)[:, 1], rel=1e-5)
    assert stresses(np.array([A, B]))[:, 0] == pytest.approx([0.0, 0.0], abs=1e-3)


def test_conductivity_that_falls_with_temperature() -> None:
    """With k(T) it is the conduction integral that is logarithmic in r."""
    table = Table("temperature", (300.0, 400.0, 600.0), (400.0, 380.0, 330.0))
    copper = Copper(table, Constant(ALPHA), Constant(E), Constant(NU), COLD)
    tube = round_tube(3)
    heated = Conduction(tube, copper).solve(FaceLoad(2.0 * FLUX, H, COLD))
    r = np.hypot(*tube.scalars.tabulate_dof_coordinates()[:, :2].T)
    outer = COLD + 2.0 * FLUX * A / (H * B)
    theta = copper.conduction_integral(np.full_like(r, outer)) + 2.0 * FLUX * A * np.log(B / r)
    assert heated.temperature.x.array == pytest.approx(copper.temperature(theta), abs=2e-3)
    assert heated.newton <= 5
    assert heated.supplied == pytest.approx(heated.removed, rel=1e-9)


def test_faces_of_given_temperature() -> None:
    tube = round_tube(3)
    heated = Conduction(tube, plain_copper()).solve(FaceLoad(hot=460.0, outer=360.0))
    r = np.hypot(*tube.scalars.tabulate_dof_coordinates()[:, :2].T)
    exact = 360.0 + 100.0 * np.log(B / r) / np.log(B / A)
    assert heated.temperature.x.array == pytest.approx(exact, abs=1e-3)
