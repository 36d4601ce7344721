"""Pictures whose eyes move, made as tests of them want them."""

from looks_of_pictures import lit
from sessions import look_of

from relume.moving.fine_job import FineJob
from relume.moving.picture import MovingPicture


def seen(moving, *changes, eye=None, size=(48, 36)):
    picture = MovingPicture(moving, "front")
    picture.set_look(look_of(moving, lit(*changes)))
    if eye is not None:
        picture.set_eye(eye, size)
    picture.advance(None)
    return picture


def begun(moving, *changes):
    """A picture that somebody watches, all its light there, its highlights not found finely yet."""
    picture = MovingPicture(moving, "front", is_watched=True)
    picture.set_look(look_of(moving, lit(*changes)))
    picture.advance(None)
    find_light(picture)
    return picture


def find_light(picture):
    """What follows when a hand rests, but for fine highlights."""
    while not isinstance(job := picture.next_job(), FineJob):
        picture.install(job, made(job))
        picture.advance(None)


def made(job):
    return job.make(lambda share: None, lambda: False)


def rest(picture):
    """As when a hand rests."""
    while (job := picture.next_job()) is not None:
        picture.install(job, made(job))
        picture.advance(None)
    assert picture.advance(None).fidelity == "approximate"
