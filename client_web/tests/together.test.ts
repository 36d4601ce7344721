/** Two people on one look: what both have converges, and each undoes their own edits. */
import { beforeEach, describe, expect, test, vi } from "vitest";
import { changeAt, changeBy } from "../src/document/change";
import { differenceOf } from "../src/document/difference";
import { edit, onChange } from "../src/edit/edit";
import { history } from "../src/edit/history";
import { redo, undo } from "../src/looks/undo";
import { EditQueue } from "../src/net/editQueue";
import type { Look, PatchOp } from "../src/protocol";
import { look } from "../src/state/look";
import { you } from "../src/state/together";
import { LOOK, lookWith } from "./look";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const COLOR = "/materials/Teapot/terms/1/color";
const EXPOSURE = "/display/exposure";

/** One who edits, and what is on the way to the server and back. */
class Editor {
  readonly queue = new EditQueue();
  look: Look = LOOK;
  private told: Look = LOOK;
  revision = 0;
  readonly toServer: { revision: number; patch: readonly PatchOp[] }[] = [];
  readonly fromServer: { revision: number; patch: readonly PatchOp[] }[] = [];

  constructor() {
    this.queue.reset(LOOK, 0, null, true);
    this.want(this.look);
  }

  private want(wanted: Look, change: ReturnType<typeof changeAt> | null = null): void {
    this.look = wanted;
    this.queue.want({ look: wanted, hand: null, solo: null, inputTime: 0 }, change);
  }

  /** Show another look of which no edit is known that leads there. */
  show(next: Look): void {
    this.want(next);
  }

  edit(path: string, value: unknown, sends = true): void {
    const change = changeAt(this.look, path, value);
    this.want(change.after, change);
    if (sends) this.toServer.push(...this.queue.take());
  }

  send(): void {
    this.toServer.push(...this.queue.take());
  }

  tell(room: Look): void {
    this.fromServer.push({ revision: this.revision, patch: differenceOf(this.told, room) });
    this.told = room;
  }

  hear(): void {
    for (const { patch, revision } of this.fromServer.splice(0)) this.look = this.queue.follow(patch, revision) as Look;
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
      room = changeBy(room, patch).after;
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

  test("of one place the last that came to the server is what both have, whoever was told when", () => {
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
    ann.queue.join(meanwhile, ann.revision, null);
    expect(ann.queue.look).toEqual(lookWith(lookWith(meanwhile, SIGMA, 0.3), EXPOSURE, 1));
    const [sent] = ann.queue.take();
    expect(sent?.patch.map(({ path }) => path)).toEqual([SIGMA, EXPOSURE]);
  });

  test("a refused edit is taken away from what others have made meanwhile", () => {
    ann.edit(SIGMA, 99);
    bob.edit(COLOR, [0, 0, 1]);
    serve(bob);
    ann.hear();
    expect(ann.queue.refuse(1)).toEqual(lookWith(LOOK, COLOR, [0, 0, 1]));
  });
});

describe("undo", () => {
  beforeEach(() => {
    vi.stubGlobal("window", { setTimeout: () => 0 });
    onChange(() => undefined);
    history.clear();
    look.value = LOOK;
    you.value = 1;
    return () => (you.value = null);
  });

  const others = (path: string, value: unknown) => (look.value = lookWith(look.value as Look, path, value));

  async function press(key: () => void): Promise<void> {
    key();
    await vi.waitFor(() => expect(history.heading).toBe(history.cursor.value));
  }

  test("takes back the own edit and leaves what others did since", async () => {
    edit("σ", SIGMA, 0.5);
    others(COLOR, [0, 0, 1]);
    await press(undo);
    expect(look.value).toEqual(lookWith(LOOK, COLOR, [0, 0, 1]));
    await press(redo);
    expect(look.value).toEqual(lookWith(lookWith(LOOK, COLOR, [0, 0, 1]), SIGMA, 0.5));
  });

  test("does not take back what another made of the same place since", async () => {
    edit("σ", SIGMA, 0.5);
    others(SIGMA, 0.9);
    await press(undo);
    expect(look.value).toEqual(lookWith(LOOK, SIGMA, 0.9));
    expect(history.canUndo).toBe(false);
  });
});
