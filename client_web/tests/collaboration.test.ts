/** Two people on one look: what both have converges, and each undoes their own edits. */
import { beforeEach, describe, expect, test, vi } from "vitest";
import { changeValue, changeByPatch } from "../src/state/document/jsonPatch";
import { diffLooks } from "../src/state/document/difference";
import { editValue, onLookChange } from "../src/edit/edit";
import { history } from "../src/edit/history";
import { redo, undo } from "../src/panels/looks/undoRedo";
import { EditQueue } from "../src/session/net/editQueue";
import type { Look, PatchOp } from "../src/protocol";
import { look } from "../src/state/look";
import { selfNumber } from "../src/state/collaboration";
import { LOOK, lookWith } from "./exampleLook";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const COLOR = "/materials/Teapot/terms/1/color";
const EXPOSURE = "/display/exposure";

/** One who edits, and what is on the way to the server and back. */
class Editor {
  readonly queue = new EditQueue();
  look: Look = LOOK;
  private sharedLook: Look = LOOK;
  revision = 0;
  readonly toServer: { revision: number; patch: readonly PatchOp[] }[] = [];
  readonly fromServer: { revision: number; patch: readonly PatchOp[] }[] = [];

  constructor() {
    this.queue.reset(LOOK, 0, null, true);
    this.setTarget(this.look);
  }

  private setTarget(target: Look, change: ReturnType<typeof changeValue> | null = null): void {
    this.look = target;
    this.queue.setTarget({ look: target, activeControl: null, solo: null, inputTime: 0 }, change);
  }

  /** Show another look of which no edit is known that leads there. */
  show(next: Look): void {
    this.setTarget(next);
  }

  edit(path: string, value: unknown, sends = true): void {
    const change = changeValue(this.look, path, value);
    this.setTarget(change.after, change);
    if (sends) this.toServer.push(...this.queue.takeEdits());
  }

  send(): void {
    this.toServer.push(...this.queue.takeEdits());
  }

  tell(room: Look): void {
    this.fromServer.push({ revision: this.revision, patch: diffLooks(this.sharedLook, room) });
    this.sharedLook = room;
  }

  hear(): void {
    for (const { patch, revision } of this.fromServer.splice(0)) this.look = this.queue.applyRemote(patch, revision) as Look;
  }
}

describe("a shared look", () => {
  let room: Look;
  let ann: Editor;
  let bob: Editor;

  beforeEach(() => {
    [room, ann, bob] = [LOOK, new Editor(), new Editor()];
  });

  /** The server takes what somebody has sent, and has something to say to both. */
  function serve(from: Editor): void {
    for (const { patch, revision } of from.toServer.splice(0)) {
      room = changeByPatch(room, patch).after;
      from.revision = revision;
    }
    for (const each of [ann, bob]) each.tell(room);
  }

  function settle(): void {
    for (const each of [ann, bob]) each.send();
    serve(ann);
    serve(bob);
    for (const each of [ann, bob]) each.hear();
  }

  test("edits of different places are merged", () => {
    ann.edit(SIGMA, 0.7);
    bob.edit(COLOR, [0, 0, 1]);
    settle();
    expect(ann.look).toEqual(lookWith(lookWith(LOOK, SIGMA, 0.7), COLOR, [0, 0, 1]));
    expect(bob.look).toEqual(ann.look);
  });

  test("of edits of one value, the last one received by the server wins for both", () => {
    for (const [first, last, value] of [
      [ann, bob, 0.4],
      [bob, ann, 0.6],
    ] as const) {
      first.edit(SIGMA, value + 0.1);
      last.edit(SIGMA, value);
      serve(first);
      last.hear();
      expect(last.look).toEqual(lookWith(LOOK, SIGMA, value)); // the own edit is on its way and stays on top
      settle();
      expect(first.look).toEqual(lookWith(LOOK, SIGMA, value));
      expect(last.look).toEqual(first.look);
    }
  });

  test("what was not sent yet stays on top of what others edit", () => {
    ann.edit(SIGMA, 0.3, false);
    bob.edit(SIGMA, 0.4);
    bob.edit(COLOR, [1, 0, 0]);
    serve(bob);
    ann.hear();
    expect(ann.look).toEqual(lookWith(lookWith(LOOK, SIGMA, 0.3), COLOR, [1, 0, 0]));
    settle();
    expect(room).toEqual(ann.look);
    expect(bob.look).toEqual(room);
  });

  test("what was not sent stays also where no edit is known that leads there", () => {
    ann.show(lookWith(LOOK, SIGMA, 0.3));
    bob.edit(COLOR, [1, 0, 0]);
    serve(bob);
    ann.hear();
    expect(ann.look).toEqual(lookWith(lookWith(LOOK, SIGMA, 0.3), COLOR, [1, 0, 0]));
    settle();
    expect(bob.look).toEqual(ann.look);
  });

  test("an edit inside something that another has removed is gone with it", () => {
    ann.edit("/materials/Teapot/terms", [LOOK.materials["Teapot"]?.terms[0]]);
    bob.edit(SIGMA, 0.4, false);
    serve(ann);
    bob.hear();
    expect(bob.look).toEqual(ann.look);
  });

  test("after a lost connection what was edited goes on top of what the room has become", () => {
    ann.edit(COLOR, [0, 1, 0]);
    serve(ann);
    ann.hear();
    ann.edit(SIGMA, 0.3); // lost
    ann.edit(EXPOSURE, 1, false);
    const meanwhile = lookWith(room, "/environment/rotation", 2);
    ann.queue.joinRoom(meanwhile, ann.revision, null);
    expect(ann.queue.look).toEqual(lookWith(lookWith(meanwhile, SIGMA, 0.3), EXPOSURE, 1));
    const [sent] = ann.queue.takeEdits();
    expect(sent?.patch.map(({ path }) => path)).toEqual([SIGMA, EXPOSURE]);
  });

  test("a refused edit is taken away from what others have made meanwhile", () => {
    ann.edit(SIGMA, 99);
    bob.edit(COLOR, [0, 0, 1]);
    serve(bob);
    ann.hear();
    expect(ann.queue.rejectRevision(1)).toEqual(lookWith(LOOK, COLOR, [0, 0, 1]));
  });
});

describe("undo", () => {
  beforeEach(() => {
    vi.stubGlobal("window", { setTimeout: () => 0 });
    onLookChange(() => undefined);
    history.clear();
    look.value = LOOK;
    selfNumber.value = 1;
    return () => (selfNumber.value = null);
  });

  const editAsOther = (path: string, value: unknown) => (look.value = lookWith(look.value as Look, path, value));

  async function press(key: () => Promise<void>): Promise<void> {
    await key();
    await vi.waitFor(() => expect(history.targetCursor).toBe(history.cursor.value));
  }

  test("takes back the own edit and leaves what others did since", async () => {
    editValue("σ", SIGMA, 0.5);
    editAsOther(COLOR, [0, 0, 1]);
    await press(undo);
    expect(look.value).toEqual(lookWith(LOOK, COLOR, [0, 0, 1]));
    await press(redo);
    expect(look.value).toEqual(lookWith(lookWith(LOOK, COLOR, [0, 0, 1]), SIGMA, 0.5));
  });

  test("does not take back what another made of the same place since", async () => {
    editValue("σ", SIGMA, 0.5);
    editAsOther(SIGMA, 0.9);
    await press(undo);
    expect(look.value).toEqual(lookWith(LOOK, SIGMA, 0.9));
    expect(history.canUndo).toBe(false);
  });
});
