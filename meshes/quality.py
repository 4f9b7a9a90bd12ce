"""Geometry of cells: Jacobians, angles, sizes, growth between neighbours, area.

Everything is evaluated on the true mapping of the cells, so that a second-order cell whose curved
side crosses another is detected. Nodes are in DOLFINx order (quadrilaterals in tensor order).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

QUAD_EDGES = ((0, 1), (1, 3), (3, 2), (2, 0))
"""Sides of a quadrilateral in tensor order, counter-clockwise."""
TRIANGLE_EDGES = ((0, 1), (1, 2), (2, 0))
"""Sides of a triangle, counter-clockwise."""

# Reference coordinates of the nodes in DOLFINx order; the vertices come first.
_TRIANGLE_NODES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
_QUAD_NODES = np.array(
    [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0], [0, 0.5], [1, 0.5], [0.5, 1], [0.5, 0.5]]
)
_GAUSS = 0.5 + 0.5 * np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
_GAUSS_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


@dataclass(frozen=True, slots=True)
class Quality:
    """Numbers that say how good a mesh is."""

    cells: int  #: number of cells
    points: int  #: number of points (vertices and, at second order, the other nodes)
    vertices: int  #: number of vertices
    facets: int  #: number of boundary facets
    smallest_size: float  #: smallest distance between opposite sides (height for triangles), m
    largest_size: float  #: largest side, m
    #: smallest over vertices of det J / product of the column lengths; 1 is a right angle
    #: (triangles: times 2/sqrt(3), 1 is equilateral)
    min_scaled_jacobian: float
    min_jacobian_ratio: float  #: smallest over cells of (smallest det J / largest det J)
    #: largest ratio of longest to shortest side (triangles: 1 is equilateral)
    max_aspect_ratio: float
    min_angle: float  #: smallest angle in a corner of a cell, degrees
    max_angle: float  #: largest angle, degrees
    #: largest ratio of the sizes of two neighbours, taken across their common side (triangles:
    #: square root of the ratio of areas)
    max_growth: float
    #: Triangles: smallest over sides of (cot a + cot b) / 2, a and b the angles opposite to it;
    #: where it is not negative the P1 stiffness matrix is an M-matrix. For quadrilaterals: 0 when
    #: all are rectangles, else minus the largest |cos| of an angle.
    min_cotangent: float
    area: float  #: area of the mesh, m2
    exact_area: float  #: area of the section modelled, m2

    @property
    def area_error(self) -> float:
        """Relative difference of the mesh's area and the section's; only arcs contribute."""
        return self.area / self.exact_area - 1.0


def edges_of(cell: str) -> tuple[tuple[int, int], ...]:
    """Sides of a cell as pairs of local vertices, counter-clockwise."""
    return QUAD_EDGES if cell == "quadrilateral" else TRIANGLE_EDGES


def vertex_count(cell: str) -> int:
    """Vertices of a cell."""
    return 4 if cell == "quadrilateral" else 3


def reference_nodes(cell: str, order: int) -> np.ndarray:
    """Reference coordinates (k, 2) of the nodes of a cell in DOLFINx order."""
    if cell == "quadrilateral":
        return _QUAD_NODES[: 4 if order == 1 else 9]
    return _TRIANGLE_NODES[: 3 if order == 1 else 6]


def _powers(cell: str, order: int) -> np.ndarray:
    if cell == "quadrilateral":
        return np.array([(i, j) for j in range(order + 1) for i in range(order + 1)])
    return np.array([(i, j) for j in range(order + 1) for i in range(order + 1 - j)])


def shape_gradients(cell: str, order: int, at: np.ndarray) -> np.ndarray:
    """Gradients (q, k, 2) of the k shape functions at reference points (q, 2)."""
    nodes, powers = reference_nodes(cell, order), _powers(cell, order)
    i, j = powers.T
    inverse = np.linalg.inv(nodes[:, :1] ** i * nodes[:, 1:] ** j)
    x, y = at[:, :1], at[:, 1:]
    by_x = i * x ** np.maximum(i - 1, 0) * y**j
    by_y = j * x**i * y ** np.maximum(j - 1, 0)
    return np.stack([by_x @ inverse, by_y @ inverse], axis=2)


def jacobians(points: np.ndarray, cells: np.ndarray, cell: str, at: np.ndarray) -> np.ndarray:
    """Jacobian matrices (m, q, 2, 2), d x_a / d xi_b, at reference points (q, 2)."""
    order = 1 if cells.shape[1] == vertex_count(cell) else 2
    gradients = shape_gradients(cell, order, np.asarray(at, dtype=float))
    return np.einsum("mka,qkb->mqab", points[cells], gradients)


def determinants(points: np.ndarray, cells: np.ndarray, cell: str) -> np.ndarray:
    """Determinants (m, q) of the mapping at all nodes and at the points of a Gauss rule."""
    gauss, _ = quadrature(cell)
    at = np.concatenate([reference_nodes(cell, 2), gauss])
    return np.linalg.det(jacobians(points, cells, cell, at))


def quadrature(cell: str) -> tuple[np.ndarray, np.ndarray]:
    """Points (q, 2) and weights (q,) that integrate det J of a second-order cell exactly."""
    if cell == "quadrilateral":
        x, y = np.meshgrid(_GAUSS, _GAUSS)
        at = np.stack([x.ravel(), y.ravel()], axis=1)
        return at, np.outer(_GAUSS_WEIGHTS, _GAUSS_WEIGHTS).ravel()
    at = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])
    return at, np.full(3, 1.0 / 6.0)


def area(points: np.ndarray, cells: np.ndarray, cell: str) -> float:
    """Area of a mesh, m2, by exact quadrature of det J."""
    at, weights = quadrature(cell)
    return float((np.linalg.det(jacobians(points, cells, cell, at)) @ weights).sum())


def corner_measures(
    points: np.ndarray, cells: np.ndarray, cell: str
) -> tuple[np.ndarray, np.ndarray]:
    """Scaled Jacobian and angle (degrees), both (m, corners), of the true mapping at vertices."""
    n = vertex_count(cell)
    jac = jacobians(points, cells, cell, reference_nodes(cell, 1))
    a, b = jac[..., 0], jac[..., 1]  # columns, each (m, n, 2)
    if cell == "quadrilateral":
        forward = np.stack([a[:, 0], b[:, 1], -b[:, 2], -a[:, 3]], axis=1)
        backward = np.stack([b[:, 0], -a[:, 1], a[:, 2], -b[:, 3]], axis=1)
    else:
        forward = np.stack([a[:, 0], b[:, 1] - a[:, 1], -b[:, 2]], axis=1)
        backward = np.stack([b[:, 0], -a[:, 1], a[:, 2] - b[:, 2]], axis=1)
    cross = forward[..., 0] * backward[..., 1] - forward[..., 1] * backward[..., 0]
    dot = np.einsum("mna,mna->mn", forward, backward)
    lengths = np.hypot(*np.moveaxis(forward, -1, 0)) * np.hypot(*np.moveaxis(backward, -1, 0))
    scale = 1.0 if n == 4 else 2.0 / np.sqrt(3.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        scaled = np.nan_to_num(scale * cross / lengths, nan=-1.0)
    return scaled, np.degrees(np.arctan2(cross, dot)) % 360.0


def pair_up(cells: np.ndarray, cell: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Match the sides of the cells.

    Returns:
        Interior pairs (p, 2) of side numbers, boundary sides (f,), and all sides (s, 2) as vertex
        pairs; side number = cell * sides per cell + local side.

    Raises:
        ValueError: More than two cells share a side.
    """
    local = np.array(edges_of(cell))
    sides = cells[:, local].reshape(-1, 2)
    ordered = np.sort(sides, axis=1)
    key = ordered[:, 0] * (int(cells.max()) + 1) + ordered[:, 1]
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    count = np.diff(np.r_[first, len(key)])
    if (count > 2).any():
        raise ValueError("more than two cells share a side: the mesh is not a plane section")
    twins = first[count == 2]
    return np.stack([order[twins], order[twins + 1]], axis=1), order[first[count == 1]], sides


def measure(points: np.ndarray, cells: np.ndarray, cell: str, exact_area: float) -> Quality:
    """All numbers of `Quality` for one mesh; points (n, 2) m, cells (m, k)."""
    n = vertex_count(cell)
    vertices = cells[:, :n]
    pairs, boundary, sides = pair_up(vertices, cell)
    lengths = np.hypot(*(points[sides[:, 1]] - points[sides[:, 0]]).T).reshape(-1, n)
    scaled, angles = corner_measures(points, cells, cell)
    dets = determinants(points, cells, cell)
    flat = np.abs(np.linalg.det(jacobians(points, vertices, cell, reference_nodes(cell, 1))))
    if n == 4:
        areas = flat.mean(axis=1)
        widths = 0.5 * (lengths + np.roll(lengths, 2, axis=1))
        heights = areas[:, None] / widths
        aspect = lengths.max(axis=1) / lengths.min(axis=1)
        across = heights.ravel()[pairs]
        cosines = np.abs(np.cos(np.radians(angles)))
        cotangent = -float(cosines.max()) if cosines.max() > 1e-9 else 0.0
    else:
        areas = 0.5 * flat[:, 0]
        heights = 2.0 * areas[:, None] / lengths
        aspect = lengths.max(axis=1) * lengths.sum(axis=1) / (4.0 * np.sqrt(3.0) * areas)
        across = np.sqrt(areas)[pairs // 3]
        # The angle opposite to side i (from vertex i to i + 1) is at vertex i + 2.
        opposite = 1.0 / np.tan(np.radians(np.roll(angles, -2, axis=1))).ravel()
        cotangent = 0.5 * min(
            float(opposite[pairs].sum(axis=1).min(initial=np.inf)),
            float(opposite[boundary].min()),
        )
    growth = across.max(axis=1) / across.min(axis=1)
    return Quality(
        cells=len(cells),
        points=len(points),
        vertices=len(np.unique(vertices)),
        facets=len(boundary),
        smallest_size=float(heights.min()),
        largest_size=float(lengths.max()),
        min_scaled_jacobian=float(scaled.min()),
        min_jacobian_ratio=float((dets.min(axis=1) / dets.max(axis=1)).min()),
        max_aspect_ratio=float(aspect.max()),
        min_angle=float(angles.min()),
        max_angle=float(angles.max()),
        max_growth=float(growth.max(initial=1.0)),
        min_cotangent=cotangent,
        area=area(points, cells, cell),
        exact_area=exact_area,
    )
