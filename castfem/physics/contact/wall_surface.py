"""The strand's surface where it meets a wall: what all slices on one mesh share."""

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
    """What all slices on a mesh share that meet a wall with some groups."""

    facets: Facets  #: points
    strand: StrandSurface  #: where they are, and how far off a wall is
    #: mean height of the surface cells, m: one for all points, so that uniform pressure is a
    #: uniform penetration (patch test)
    height: float
    temperatures: SurfaceTemperatures  #: at the points
    #: how they are strained, for Nitsche's method; None with the penalty
    strained: SurfaceStrain | None
    geometry: forms.Surface  #: of the surface, as the forms see it
    given: FacetFields  #: what the forms see of the wall

    @classmethod
    def of(
        cls, section: Section, contact: Contact, solid: Solid, motion: Motion, columns: int
    ) -> WallSurface:
        """That of the groups of a contact, with so many columns of what forms see (collective)."""
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
