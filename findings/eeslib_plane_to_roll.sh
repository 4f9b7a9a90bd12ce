#!/bin/bash
# eeslib gives the view factor of a roll to a strand for that of the strand to the roll, half of it.
#
# Versions: eeslib 0.0.5, NumPy 2.4.6, SciPy 1.17.1 (Python 3.11, 3.12).
#
# `f2d_03` and `f2d_06` are described as the view factor from a plane of finite width to a parallel
# cylinder. What they return is the factor from the cylinder to the plane: it is the same for a
# roll of any radius, which f2d_03 asks for, and f2d_06 names and does not take. From a strip of
# 300 mm beside a roll of 200 mm diameter it has 0.070 for 0.148, less than half of the radiation of
# the strip that meets the roll; at 100 mm it is nearly right. No message is given.
# Multiply by the circumference of the roll and divide by the width of the plane.
#
# Output seen (plane 300 mm below the axis, from 200 to 500 mm aside; rays +- 0.0004):
#   radius 50 mm: exact 0.0737, rays 0.0735, f2d_03 0.0704
#   radius 100 mm: exact 0.1475, rays 0.1474, f2d_03 0.0704
#   radius 150 mm: exact 0.2212, rays 0.2211, f2d_03 0.0704
#   times the circumference, over the width: 0.0737, 0.1475, 0.2212
#   f2d_06, plane 500 mm to each side: 0.3280, exact for 100 mm 0.2061
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q eeslib==0.0.5 numpy==2.4.6 scipy==1.17.1
cd "$work"
venv/bin/python - <<'END'
import math
import sys

import numpy as np
from eeslib import radiation

HEIGHT, NEAR, FAR, RAYS = 0.3, 0.2, 0.5, 1_000_000
WIDTH = FAR - NEAR


def exact_factor(radius, near, far):
    """From the plane to the roll: the angle that the plane fills, seen from the axis."""
    angle = math.atan(far / HEIGHT) - math.atan(near / HEIGHT)
    return radius * angle / (far - near)


def by_rays(radius):
    """Share of the diffuse rays of the plane that meet the roll, whose axis is at x = 0."""
    draw = np.random.default_rng(1)
    start = draw.uniform(NEAR, FAR, RAYS)
    sine = draw.uniform(-1.0, 1.0, RAYS)
    cosine = np.sqrt(1.0 - sine**2)
    passes = np.abs(-start * cosine - HEIGHT * sine)
    ahead = -start * sine + HEIGHT * cosine > 0.0
    return float(np.mean((passes < radius) & ahead))


same, turned = True, []
for radius in (0.05, 0.1, 0.15):
    true, rays = exact_factor(radius, NEAR, FAR), by_rays(radius)
    seen = float(radiation.f2d_03(radius, HEIGHT, FAR, NEAR))
    turned.append(seen * 2.0 * math.pi * radius / WIDTH)
    name = f"radius {1e3 * radius:.0f} mm"
    print(f"{name}: exact {true:.4f}, rays {rays:.4f}, f2d_03 {seen:.4f}")
    same = same and abs(rays - true) < 0.002 and abs(turned[-1] - true) < 1e-9
    same = same and abs(seen - 0.0704) < 1e-4
print("times the circumference, over the width:", ", ".join(f"{f:.4f}" for f in turned))
both, true = float(radiation.f2d_06(HEIGHT, FAR)), exact_factor(0.1, -FAR, FAR)
print(f"f2d_06, plane 500 mm to each side: {both:.4f}, exact for 100 mm {true:.4f}")
same = same and abs(both - 0.3280) < 1e-4 and true < 0.21
sys.exit(0 if same else "eeslib has changed")
END
