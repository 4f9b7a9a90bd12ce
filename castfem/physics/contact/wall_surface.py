"""Data of the strand's surface at a wall that all slices on one mesh share."""

from __future__ import annotations

from dataclasses import dataclass

from castfem.fem import reductions
from castfem.fem.section import Section
from castfem.forms import contact as forms
from castfem.forms import finite_strain
from castfem.physics.contact.facets import FacetFields, Facets
from castfem.physics.contact.interaction import Motion, Solid
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.strand_surface import StrandSurface
from castfem.physics.contact.surface_liquid import SurfaceTemperatures
from castfem.physics.contact.surface_stress import SurfaceStrain


@dataclass(frozen=True, slots=True)
class WallSurface:
    """Data of some boundary groups at a wall, shared by all slices on a mesh."""

    facets: Facets  #: the points
    strand: StrandSurface  #: geometry of the points, and distance to a wall
    #: mean height of the surface cells, m: one for all points, so that uniform pressure gives
    #: uniform penetration (patch test)
    height: float
    temperatures: SurfaceTemperatures  #: temperatures at the points
    #: strain of the points, for Nitsche's method; None with the penalty
    strained: SurfaceStrain | None
    geometry: forms.Surface  #: geometry of the surface for the forms
    given: FacetFields  #: coefficients of the wall for the forms

    @classmethod
    def of(
        cls, section: Section, contact: Contact, solid: Solid, motion: Motion, columns: int
    ) -> WallSurface:
        """Make the data for the groups of a contact, with a number of coefficients (collective)."""
        mesh = section.mesh
        facets = Facets(section, section.required(contact.on), contact.points)
        slopes = solid.liquid == "fed" and contact.friction is not None
        temperatures = SurfaceTemperatures.at(facets, slopes)
        strand = StrandSurface(section, facets, motion, solid.large_strain)
        geometry: forms.Surface = forms.Undeformed(mesh)
        step = None
        if solid.large_strain:
            now = finite_strain.deformation(motion.u, motion.generalized_strains, mesh)
            old = finite_strain.deformation(motion.u_old, motion.generalized_strains_old, mesh)
            geometry, step = forms.Deformed(now, old, mesh), (now, old)
        strained = None
        if contact.method == "nitsche":
            strained = SurfaceStrain.at(facets, strand.gradients, motion, step)
        weight = facets.weight
        length, area = reductions.totals(section.comm, [weight.sum(), weight @ facets.height])
        given = FacetFields(facets, columns)
        return cls(facets, strand, area / length, temperatures, strained, geometry, given)
