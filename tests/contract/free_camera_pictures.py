"""Free-camera pictures for tests."""

from look_edits import add_lights
from session_edits import kind_of, make_look

from relume.live.free_camera.free_camera_picture import FreeCameraPicture


def make_picture(views, *changes, camera=None, size=(48, 36)):
    picture = FreeCameraPicture(views, "front")
    picture.set_look(make_look(views, add_lights(*changes)))
    if camera is not None:
        picture.set_camera(camera, size)
    picture.advance(None)
    return picture


def make_watched_picture(views, *changes):
    """A watched picture with complete lighting, before highlights are refined."""
    picture = FreeCameraPicture(views, "front", is_watched=True)
    picture.set_look(make_look(views, add_lights(*changes)))
    picture.advance(None)
    finish_lighting(picture)
    return picture


def finish_lighting(picture):
    """Run all pending jobs except the refinement of highlights."""
    while kind_of(job := picture.next_job()) != "highlights":
        job.apply(run_job(job))
        picture.advance(None)


def run_job(job):
    return job.run(lambda share: None, lambda: False)


def finish_refinement(picture):
    """Run all pending jobs."""
    while (job := picture.next_job()) is not None:
        job.apply(run_job(job))
        picture.advance(None)
    assert picture.advance(None).fidelity == "approximate"
