"""Pictures whose eyes move, made as tests of them want them."""

from look_edits import add_lights
from session_edits import make_look

from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.refine_job import RefineHighlights


def make_picture(views, *changes, camera=None, size=(48, 36)):
    picture = FreeCameraPicture(views, "front")
    picture.set_look(make_look(views, add_lights(*changes)))
    if camera is not None:
        picture.set_camera(camera, size)
    picture.advance(None)
    return picture


def make_watched_picture(views, *changes):
    """A picture that somebody watches, all its light there, its highlights not found finely yet."""
    picture = FreeCameraPicture(views, "front", is_watched=True)
    picture.set_look(make_look(views, add_lights(*changes)))
    picture.advance(None)
    finish_lighting(picture)
    return picture


def finish_lighting(picture):
    """What follows when a hand rests, but for fine highlights."""
    while not isinstance(job := picture.next_job(), RefineHighlights):
        picture.install(job, run_job(job))
        picture.advance(None)


def run_job(job):
    return job.run(lambda share: None, lambda: False)


def finish_refinement(picture):
    """As when a hand rests."""
    while (job := picture.next_job()) is not None:
        picture.install(job, run_job(job))
        picture.advance(None)
    assert picture.advance(None).fidelity == "approximate"
