"""The one transition: of the routes to what is wanted, the one of highest fidelity that lacks nothing makes the frame.

What the next better one lacks is made next: first what light needs to be followed, then what shows nothing at all, then
what the hand is on, then what refines a picture at rest, then what can be made ahead.

One picture, one light: what a picture shows in another light it shows there all at once. When light changes, images of
terms become ready one after another; until all of them are in one light the picture goes on showing those in the light
before, with the background, the shining surfaces and the gain of that light.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from relume.look import Look
from relume.look.model import Rgb
from relume.operators.edit_basis import CurveBasis, EditBasis
from relume.operators.frozen import Rough
from relume.operators.shade import shaded_bytes
from relume.picture.fidelity import Fidelity
from relume.picture.hand import Hand
from relume.picture.jobs import Freeze, Job, Place, Shade, goes_on_from
from relume.picture.light import Light, of_source, vector_of
from relume.picture.region import is_exact_in, is_seen, region_first
from relume.picture.routes import operator, textures
from relume.picture.routes.base import LightRoute
from relume.picture.routes.follow import Follow
from relume.picture.routes.mix import Mix
from relume.picture.routes.preview import Preview, can_preview, helps_to_open, is_prepared, is_worth_finer
from relume.picture.routes.recall import Recall
from relume.picture.thinning import EXACT, ROUGH, Form, comes_roughly, form_for
from relume.picture.view_images import ViewImages
from relume.project.levels import contract_levels


class Transition:
    """Of one picture.

    Attributes:
        light: in which the picture is shown. gain: what multiplies it.
    """

    def __init__(self, images: ViewImages, *, is_watched: bool) -> None:
        self._images, self._is_watched = images, is_watched
        self._mix, self._follow = Mix(), Follow(images)
        # highest fidelity first, and of equal ones what costs least
        self._routes: Sequence[LightRoute] = (Recall(), self._mix, self._follow)
        self._previewed: tuple[Light, Rgb] | None = None
        self.light, self.gain = images.light, images.gain
        images.shine_in(self.light)

    def go_on_with(self, images: ViewImages) -> None:
        """Bring other images of the same picture to what is wanted from now on: some of its samples are sorted anew."""
        self._images, self._follow, self._previewed = images, Follow(images), None
        self._routes = (Recall(), self._mix, self._follow)
        images.shine_in(self.light)

    # what a frame shows

    def step(self, max_coefficients: int | None) -> None:
        """Bring every term as near to what is wanted as it can be now."""
        for place in self._places():
            textures.step(place)
        self._change_light()
        for place in self._places():
            if not place.live.is_exact():
                operator.step(place, max_coefficients)

    def install(self, job: Job, made: object) -> None:
        """Go on with what a job has made."""
        job.install(made)
        if isinstance(job, Preview):
            self._previewed = job.light, job.gain
        self._change_light()

    def _change_light(self) -> None:
        """Bring terms to the light that is wanted, if all can be; else those that can to the light of a preview."""
        wanted = self._images.light
        unlit = self._unlit()
        late = [p for p in unlit if not p.live.is_blank and p.live.ready.light != wanted]
        if all(self._route(place, wanted) for place in late):
            self._bring(unlit, wanted)
        elif self._previewed is not None and any(p.live.ready.light == self._previewed[0] for p in unlit):
            self._bring(unlit, self._previewed[0])
        self._show()

    def _bring(self, unlit: Iterable[Place], light: Light) -> None:
        for place in unlit:
            route, ready = self._route(place, light), place.live.ready
            if route is not None and (ready.light != light or ready.fidelity < route.fidelity):
                route.apply(place, light)

    def _route(self, place: Place, light: Light) -> LightRoute | None:
        """The best way to bring a term's curves to a light at once; none where it would not show them exactly."""
        if not place.live.lacks_only_light():
            return None
        wanted = self._images.light
        able = (r for r in self._routes if light == wanted or r.fidelity < Fidelity.NEAR)
        return next((r for r in able if r.reaches(place, light) and not r.needs(place, light)), None)

    def _show(self) -> None:
        """Show every term's newest image, if all are in one light; those that show nothing at all are in any."""
        images, before = self._images, self.light
        lit = {place.live.newest.light for place in self._places() if not place.live.is_blank}
        if lit <= {images.light}:
            self.light, self.gain, self._previewed = images.light, images.gain, None
        elif self._previewed is not None and lit == {self._previewed[0]}:
            self.light, self.gain = self._previewed
        else:
            return
        for place in self._places():
            place.live.show_ready()
        if self.light != before:
            images.shine_in(self.light)

    # what is made next

    def next_job(self, hand: Hand, look: Look) -> Job | None:
        """The most urgent job; None where nothing is lacking. hand: what the user is on. look: as it is now."""
        stages: Sequence[Callable[[Hand], Job | None]] = (
            self._rows_wanted, self._preview_wanted, self._elements_wanted, self._lacking, self._touched, self._awaited,
        )  # fmt: skip
        for stage in stages:
            found = stage(hand)
            if found is not None:
                return found
        return self._refining() or self._ahead(hand, look)

    def _rows_wanted(self, hand: Hand) -> Job | None:
        """Light has changed under a hand, and only rows can follow it."""
        if not hand.moves_light or not self._must_follow():
            return None
        return self._rows()

    def _preview_wanted(self, hand: Hand) -> Job | None:
        """The picture is in another light than is wanted, or opens; or samples are chosen before the light turns."""
        images = self._images
        if self._lacks_preview(hand):
            is_opening = all(place.live.is_blank for place in self._places())
            lacking = [place for place in self._unlit() if self._route(place, images.light) is None]
            whole = Preview.of(images, lacking, "a preview" if is_opening else "the light")
            paths = images.light.paths
            return whole.sooner() if is_opening and paths.direct and paths.reflect else whole
        outdated = [p for p in self._places() if p.live.shows_another and not images.is_at_hand(p.material, p.live)]
        if outdated and self._is_watched and can_preview(images):
            return Preview.of(images, outdated, "what was changed")
        if hand.is_turning and can_preview(images) and not is_prepared(images):
            return Preview.of(images, self._places(), "the light")
        return None

    def _lacks_preview(self, hand: Hand) -> bool:
        images = self._images
        if all(place.live.is_blank for place in self._places()):
            return self._is_watched and helps_to_open(images)
        if self.light == images.light or not can_preview(images):
            return False
        is_at_once = all(self._route(place, images.light) is not None for place in self._unlit())
        return not is_at_once and not (hand.moves_light and self._must_follow())

    def _must_follow(self) -> bool:
        """Whether every term shows what is wanted, or will, roughly, with rows; and gains alone do not explain it."""
        wanted, follow = self._images.light, self._follow
        unlit = self._unlit()
        reached = all(p.live.lacks_only_light() and follow.reaches(p, wanted) for p in unlit)
        is_moved = any(not self._mix.reaches(place, wanted) for place in unlit)
        return bool(unlit) and reached and is_moved and follow.has_room()

    def _elements_wanted(self, hand: Hand) -> Job | None:
        """The image of a source that is lacking to mix a term, of a material with few samples first."""
        unlit = (place for place in self._places() if place.live.lacks_only_light())
        return _first_lacking(self._mix, unlit, self._images.light)

    def _lacking(self, hand: Hand) -> Job | None:
        """One job for each term whose image is not what is wanted and follows no operator towards it; those first of
        which something is to be seen that is not exact; of them those of the touched material, and cheap ones."""
        candidates, region = list(self._bases_lacking(hand)), self._images.region
        if not candidates:
            return None

        def rank(item: tuple[Place, EditBasis | None]) -> tuple[int, ...]:
            place, basis = item
            return not is_seen(place, region) or is_exact_in(place, region), *_cost(place, basis, hand)

        place, basis = min(candidates, key=rank)
        form = None if basis is None else self._form(place, basis)
        if basis is not None and form is not None:
            return self._freeze(place, basis, form)
        # where no operator fits, an image that shows older curves stands until the hand rests
        whole = Shade.of(place, self._images.light, refines=place.live.is_firm or place.live.is_seen())
        return self._sooner(whole, [other for other, basis in candidates if basis is None]) or whole

    def _sooner(self, whole: Shade, lacking: Sequence[Place]) -> Job | None:
        """What is seen sooner than the whole image of a term, where many samples are to be shaded: what of it is in
        sight, or all that is lacking in more detail. lacking: terms that are to be shaded, this one among them."""
        part = region_first(whole, lacking, self._images.region)
        of_place = whole.place
        detail = of_place.live.ready.detail
        if of_place.live.ready.fidelity != Fidelity.PREVIEW or of_place.live.ready.light != whole.light:
            return part
        dear = [place for place in lacking if _needs_angles(place) and place.live.ready.detail == detail]
        if of_place not in dear:
            return part
        left = sum(place.material.num_samples for place in dear)
        if part is not None:
            left = sum(np.count_nonzero(p.material.lies_in(part.region)) for p in dear)
        if not is_worth_finer(left, detail):
            return part
        return Preview.of(self._images, dear, "a preview").finer(detail + 1, refines=whole.refines)

    def _bases_lacking(self, hand: Hand) -> Iterator[tuple[Place, EditBasis | None]]:
        for place in self._places():
            live = place.live
            differing = set(live.differing())
            basis = hand.basis_of(live, differing)
            if not live.is_firm:
                # its operator along a curve gives the image as well, and exactly
                is_whole = basis is not None and basis.is_complete and self._form(place, basis) == EXACT
                yield place, basis if is_whole else None
            elif differing and not self._follows(place, basis):
                first = next(name for name in live.target if name in differing)
                wanted = basis or CurveBasis.of(live.term.curve(first))
                yield place, wanted if self._serves(place, wanted, differing) else None

    def _form(self, place: Place, basis: EditBasis) -> Form | None:
        """What the memory may hold an operator of; where of nothing, the term is shaded."""
        return form_for(place.material, basis.num_columns, self._images.cache.budget_bytes)

    def _serves(self, place: Place, basis: EditBasis, differing: set[str]) -> bool:
        """Whether an operator would bring an image to its target; one of some samples does not sum others' curves."""
        form = self._form(place, basis)
        return form is not None and (form.step == 1 or goes_on_from(place.live.ready, differing, basis))

    def _follows(self, place: Place, basis: EditBasis | None) -> bool:
        """Whether the operator in use is the one to go on with: what differs is free in it, or some of it, and no other
        is better."""
        live = place.live
        active, differing = live.ready.basis, set(live.differing())
        if active is None or differing.isdisjoint(active.moves):
            return False
        if self._images.operator(place.material, live) is None:
            return False
        return differing <= set(active.moves) or basis is None or not differing <= set(basis.moves)

    def _touched(self, hand: Hand) -> Job | None:
        """The operator that a hand must wait for before it can move what it has touched.

        A parameter whose only curve is free in all its wavelets needs no nodes: that curve's operator is there, exact.
        """
        touched = hand.touched
        if touched is None or not touched.place.material.num_samples:
            return None
        if touched.basis is None:
            return textures.job_for(touched.place)
        live, basis, active = touched.place.live, touched.basis, touched.place.live.ready.basis
        form = self._form(touched.place, basis)
        if live.differing() or form is None:
            return None
        has_operator = active is not None and self._images.operator(touched.place.material, live) is not None
        is_enough = active is not None and (active == basis or (active.is_complete and active.moves == basis.moves))
        return None if has_operator and is_enough else self._freeze(touched.place, basis, form)

    def _awaited(self, hand: Hand) -> Job | None:
        """The exact operator of what is followed by a rough one; frames go on meanwhile."""
        for place in self._places():
            basis = place.live.ready.basis
            if basis is not None and isinstance(self._images.operator(place.material, place.live), Rough):
                return Freeze.of(place, basis, EXACT)
        return None

    def _freeze(self, place: Place, basis: EditBasis, form: Form) -> Freeze:
        """An operator; the rough one first, where a hand would wait long for the exact one, and can go on by it."""
        images, (_, material, live) = self._images, place
        if form != EXACT or images.cache.holds(images.key_of_operator(material, live, basis, live.target)):
            return Freeze.of(place, basis, form)
        lights = images.transfer.num_lights if live.light.shows_sky else 0
        is_first = comes_roughly(material, basis.num_columns, lights, images.cache.budget_bytes)
        can_go_on = goes_on_from(live.ready, live.differing(), basis)
        return Freeze.of(place, basis, ROUGH if is_first and can_go_on else form)

    def _refining(self) -> Job | None:
        """What makes an image exact that is near it already."""
        for place in self._places():
            live = place.live
            if live.is_firm and not live.differing():
                found = self._settling(place) if live.ready.rounding > 0 else None
                if found is None and live.ready.fidelity < Fidelity.EXACT:
                    found = Shade.of(place, self._images.light, refines=True)
                if found is not None:
                    return found
        return None

    def _settling(self, place: Place) -> Job | None:
        """What sums an image once that was summed from steps, from where they came."""
        return self._mix.settle_job(place) if place.live.ready.basis is None else operator.settle_job(place)

    def _ahead(self, hand: Hand, look: Look) -> Job | None:
        """What can be made ahead for what a hand is on, when nothing else is lacking."""
        if hand.moves_light and self._follow.has_room():
            rows = self._rows()
            if rows is not None:
                return rows
        return self._elements_of_held(hand, look)

    def _rows(self) -> Job | None:
        """The next rows to be made, those of few samples first; None where there are all.

        A term whose own curve moves would want other rows after every edit, and could not add them to anything.
        """
        able = (p for p in self._places() if p.live.is_firm or p.live.lacks_only_light())
        return _first_lacking(self._follow, able, self._images.light)

    def _elements_of_held(self, hand: Hand, look: Look) -> Job | None:
        """An image of the light that a hand is on, of a material with few samples first; it can wait for all else.

        What comes straight from it is taken off as soon as it moves; all that comes from it is what it is dimmed by.
        None where that light is elsewhere by now, or where the memory has no room to spare.
        """
        images = self._images
        held = hand.held_light(look)
        if held is None or all(source.geometry != held for source in images.light.local):
            return None
        elements = list(vector_of(of_source(images.light, held)))  # what comes straight is first
        places = list(self._places())
        lacking = [(e, p) for e in elements for p in places if images.image_in(p.material, p.live, e) is None]
        num_bytes = sum(shaded_bytes(place.material.num_samples) for _, place in lacking)
        if not lacking or num_bytes > images.cache.budget_bytes - images.cache.used_bytes:
            return None
        element, place = min(lacking, key=lambda item: (elements.index(item[0]), item[1].material.num_samples))
        return Shade.of(place, element, refines=True)

    def _places(self) -> Iterator[Place]:
        """All terms that this view sees anything of."""
        return (Place(self._images, material, live) for material, live in self._images.terms())

    def _unlit(self) -> list[Place]:
        """Those that show nothing firm in the light that is wanted."""
        return [place for place in self._places() if not place.live.is_firm]


def _first_lacking(route: LightRoute, places: Iterable[Place], light: Light) -> Job | None:
    """The first thing that a route lacks to bring places to a light, of a material with few samples first."""
    lacking = [(place, jobs[0]) for place in places if (jobs := route.needs(place, light))]
    return min(lacking, key=lambda item: item[0].material.num_samples)[1] if lacking else None


def _cost(place: Place, basis: EditBasis | None, hand: Hand) -> tuple[bool, bool, int]:
    """Sorts what is to be made: a term whose curves are all flat needs no angles, which take nearly all the time."""
    touched = hand.touched
    is_other = touched is None or touched.place.material is not place.material
    return is_other, basis is not None or _needs_angles(place), place.material.num_samples


def _needs_angles(place: Place) -> bool:
    """Whether any curve of a term is not flat."""
    return any(c.kinds.size for c in contract_levels(place.live.term, place.live.target, None))
