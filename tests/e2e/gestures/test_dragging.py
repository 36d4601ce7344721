"""Everything that is dragged follows the hand: again, over selected text, and after a release that nobody saw."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest
from editor_page import WAIT_FOR_FRAMES, WAIT_MS, Editor
from editor_server import Server
from playwright.sync_api import Browser, Locator, expect
from test_lights import add_by_click

Place = tuple[float, float]
NUM_MOVES = 6


@pytest.fixture(scope="module")
def open_editor(server: Server, browser: Browser) -> Iterator[Editor]:
    """One page for all of these: a light is added, the ball's highlight is open, and A is beside the live picture."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    editor = Editor(context.new_page())
    (scene,) = server.call("/api/scenes")
    editor.page.goto(f"{server.url}/?scene={scene['id']}")
    editor.wait_until_exact()
    add_by_click(editor, "Point")
    yield editor
    context.close()


@dataclass(frozen=True)
class Draggable:
    """A thing that is dragged: where it is, which way it goes in pixels a move, and what of it changes; what makes it
    ready before the first drag, and after each, so that the same drag changes something again."""

    thing: Callable[[Editor], Locator]
    way: Place = (5, 0)
    read: Callable[[Editor, Locator], str | None] = lambda _, thing: thing.get_attribute("aria-valuenow")
    prepare: Callable[[Editor], object] = lambda _: None
    clear: Callable[[Editor], object] = lambda _: None


def ball(term: int) -> Callable[[Editor], None]:
    return lambda editor: editor.choose("Ball", term)


def curve(key: str) -> Callable[[Editor], None]:
    def prepare(editor: Editor) -> None:
        editor.choose("Ball", 1)
        tab = editor.page.locator(".curve-tabs button").first
        if tab.get_attribute("aria-expanded") != "true":
            tab.click()
        editor.page.locator(".plot").wait_for()
        editor.page.keyboard.press(key)

    return prepare


def slider(name: str) -> Callable[[Editor], Locator]:
    return lambda editor: editor.page.get_by_role("slider", name=name, exact=True).locator(".thumb")


def value_of(name: str) -> Callable[[Editor, Locator], str | None]:
    return lambda editor, _: editor.page.get_by_role("slider", name=name, exact=True).get_attribute("aria-valuenow")


def painted(editor: Editor, _: Locator) -> str | None:
    """The content of the plot."""
    editor.page.evaluate(WAIT_FOR_FRAMES)
    return str(editor.page.locator(".plot canvas").evaluate("canvas => canvas.toDataURL()"))


def place(_: Editor, thing: Locator) -> str | None:
    return str(thing.bounding_box())


def open_map(editor: Editor) -> None:
    editor.choose("Ball", 1)
    if editor.page.locator(".material-map").count() == 0:
        editor.page.get_by_role("button", name="Library").click()


def compared(editor: Editor) -> None:
    if editor.page.locator(".wipe").count() == 0:
        editor.page.keyboard.press("w")


WIPE = "Wipe between A and B (live)"
DRAGGABLES = {
    "exposure": Draggable(slider("Exposure"), read=value_of("Exposure")),
    "roughness": Draggable(slider("Roughness σ"), read=value_of("Roughness σ"), prepare=ball(1)),
    "rotation": Draggable(slider("Environment rotation"), read=value_of("Environment rotation")),
    "brightness": Draggable(slider("Environment brightness"), read=value_of("Environment brightness")),
    "light": Draggable(slider("Point: intensity"), read=value_of("Point: intensity")),
    "splitter": Draggable(lambda editor: editor.page.get_by_role("separator"), (-6, 0)),
    "picture": Draggable(
        lambda editor: editor.page.locator(".picture canvas").first,
        (4, 3),
        lambda editor, _: str(editor.page.locator(".light-handle.move").bounding_box()),
    ),
    "handle of a light": Draggable(lambda editor: editor.page.locator(".light-handle.move"), (4, -2), place),
    "curve point": Draggable(
        lambda editor: editor.page.locator(".plot [role=slider]").nth(1).locator(".mark"),
        (0, -4),
        lambda editor, _: editor.page.locator(".plot [role=slider]").nth(1).get_attribute("aria-valuenow"),
        curve("p"),
    ),
    "drawing": Draggable(  # over a stroke, the same stroke is no news
        lambda editor: editor.page.locator(".plot svg"),
        (6, 5),
        painted,
        curve("d"),
        lambda editor: editor.page.keyboard.press("Control+z"),
    ),
    "stretch": Draggable(lambda editor: editor.page.locator(".plot svg"), (7, 1), painted, curve("t")),
    "material map": Draggable(
        lambda editor: editor.page.locator(".material-map svg"),
        (5, 3),
        lambda editor, _: editor.page.locator(".material-map-text").inner_text(),
        open_map,
    ),
    "wipe": Draggable(lambda editor: editor.page.get_by_role("slider", name=WIPE), (9, 0), prepare=compared),
}


def middle(thing: Locator) -> Place:
    box = thing.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag(editor: Editor, it: Draggable, sign: int) -> None:
    """Drag a thing by its middle: it goes on following after the first moves, and stays where the hand lets go."""
    thing = it.thing(editor)
    (x, y), (dx, dy), mouse = middle(thing), it.way, editor.page.mouse
    before = it.read(editor, thing)
    mouse.move(x, y)
    mouse.down()
    frames = []
    for step in range(1, NUM_MOVES + 1):
        mouse.move(x + sign * step * dx, y + sign * step * dy)
        editor.page.evaluate(WAIT_FOR_FRAMES)
        frames.append(it.read(editor, thing))
    mouse.up()
    assert frames[0] != before or frames[1] != before
    assert len(set(frames[1:])) == NUM_MOVES - 1, frames
    it.clear(editor)


# ways of the same kinds of controls
LONG = {
    "brightness", "roughness", "rotation", "light", "curve point", "drawing", "stretch", "material map",
    "handle of a light",
}  # fmt: skip


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in DRAGGABLES])
def test_it_follows_the_hand_every_time(open_editor: Editor, name: str) -> None:
    editor, it = open_editor, DRAGGABLES[name]
    it.prepare(editor)
    drag(editor, it, 1)
    drag(editor, it, -1)
    editor.page.evaluate("getSelection().selectAllChildren(document.body)")
    drag(editor, it, 1)
    editor.page.evaluate("getSelection().selectAllChildren(document.body)")
    drag(editor, it, -1)
    lose(editor, it)
    drag(editor, it, 1)


def lose(editor: Editor, it: Draggable) -> None:
    """Drag a thing out of the window and let go there, unseen: back inside, it does not follow any more."""
    thing, steps = it.thing(editor), editor.page.locator(".tile.step:not(.undone)")
    (x, y), page, count = middle(thing), editor.page, steps.count()
    devtools = page.context.new_cdp_session(page)

    def send(kind: str, x: float, y: float, buttons: int) -> None:
        button = "left" if buttons else "none"
        event = {"type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1}
        devtools.send("Input.dispatchMouseEvent", event)

    send("mouseMoved", x, y, 0)
    send("mousePressed", x, y, 1)
    send("mouseMoved", x + it.way[0], y + it.way[1], 1)
    send("mouseMoved", x, y, 1)
    send("mouseMoved", x, -60, 1)
    send("mouseMoved", x + 1, y, 0)
    editor.wait_until_exact()  # handles stand where the picture that is shown has them
    let_go = it.read(editor, thing)
    for step in (2, 3):
        send("mouseMoved", x + step * it.way[0], y + step * it.way[1], 0)
    page.evaluate(WAIT_FOR_FRAMES)
    if it.read is not painted:  # there the pointer has a line of its own
        assert it.read(editor, thing) == let_go
    devtools.detach()
    page.keyboard.press("f")  # what has gone with the pointer comes back
    if steps.count() > count:
        page.keyboard.press("Control+z")


def test_the_kept_picture_is_shown_while_the_button_is_held(open_editor: Editor) -> None:
    page, hold = open_editor.page, open_editor.page.get_by_role("button", name="Show A")
    for _ in range(2):
        page.evaluate("getSelection().selectAllChildren(document.body)")
        x, y = middle(hold)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 5, y + 5, steps=4)
        expect(hold).to_have_attribute("aria-pressed", "true")
        page.mouse.up()
        expect(hold).to_have_attribute("aria-pressed", "false")


def test_a_ball_of_the_library_is_still_dragged_onto_an_object(open_editor: Editor) -> None:
    editor, page = open_editor, open_editor.page
    open_map(editor)
    page.keyboard.press("g")  # a handle may lie where it is dropped
    balls = page.locator(".library-balls button")
    balls.first.wait_for(timeout=WAIT_MS)
    page.evaluate("getSelection().selectAllChildren(document.body)")
    picture = editor.canvas.first.bounding_box()
    assert picture is not None
    where = {"x": picture["width"] / 2, "y": 0.58 * picture["height"]}
    name = balls.first.inner_text()
    balls.first.drag_to(editor.canvas.first, target_position=where)
    expect(page.locator(".tile.step .tile-name").last).to_contain_text(name)
