/** The eyes of views that move: where hands have put them, told to the server, kept over a reload. */
import { effect } from "@preact/signals";
import { send } from "../live/connections";
import { drawHere, eyeSize, isAway, leave, told } from "../live/drawing";
import { askProbe } from "../live/probing";
import type { HelloMessage, Triple } from "../protocol";
import { bake } from "../state/bakes";
import { connection } from "../state/connection";
import { placeEye } from "../state/eyes";
import { scene } from "../state/scene";
import { shownViews, views } from "../state/views";
import { Motion } from "./motion";
import { frameOf, isNear, orbitOf, type Bounds, type Frame, type Orbit } from "./orbit";

type View = HelloMessage["views"][number];

const DEGREES = 180 / Math.PI;

export type Size = [width: number, height: number];

/** Of one view of one bake. */
export class Eye {
  readonly first: Frame;
  readonly bounds: Bounds;
  private readonly begun: Orbit;
  private motion: Motion;
  private number = 0;
  private hasMoved = false;
  /** Where it is on a way that no hand makes. */
  private passing: Frame | null = null;
  /** Of its pictures; null: as large as was baked. */
  private chosenSize: Size | null = null;

  constructor(
    readonly bake: string,
    private readonly view: View,
  ) {
    const [lowest, highest] = view.bounds ?? [
      [0, 0, 0],
      [1, 1, 1],
    ];
    this.bounds = { lowest: lowest as Triple, highest: highest as Triple };
    this.first = { to_world: view.camera.to_world, yfov: view.camera.yfov * DEGREES };
    this.begun = orbitOf(this.first, this.bounds);
    const { orbit, size } = this.read();
    this.hasMoved = orbit !== null;
    this.chosenSize = size;
    this.motion = this.from(orbit ?? this.begun);
  }

  get orbit(): Orbit {
    return this.motion.target;
  }

  /** Of its pictures, where somebody chose it. */
  get chosen(): Size | null {
    return this.chosenSize;
  }

  get size(): Size {
    return this.chosenSize ?? [this.view.width, this.view.height];
  }

  /** Make pictures of this size, or, of null, as large as was baked. */
  resize(size: Size | null): void {
    this.chosenSize = size;
    this.keep();
    this.tell(this.frame);
  }

  change = (by: (orbit: Orbit) => Orbit): void => {
    this.hasMoved = true;
    this.passing = null;
    this.motion.change(by);
    this.keep();
  };

  /** From now on turn about what the middle of the picture shows; where nobody says what that is, about what it was. */
  async grasp(): Promise<void> {
    const [width, height] = eyeSize(...this.size);
    const middle = askProbe(this.view.name, Math.floor(width / 2), Math.floor(height / 2));
    const position = await middle.then((answer) => answer.position, () => null);
    if (position !== null) this.motion.restate((orbit) => orbitOf(frameOf(orbit), this.bounds, position as Triple));
  }

  /** Look at a place. */
  lookAt(place: Triple): void {
    this.change((now) => ({ ...now, target: place }));
  }

  /** Go back to where it began; its first camera may look straight down, which no orbit does. */
  restart(): void {
    this.motion.end();
    this.motion = this.from(this.begun);
    this.hasMoved = false;
    this.keep();
    this.tell(this.first);
  }

  /** Be on a way that no hand makes. */
  pass(frame: Frame): void {
    this.motion.end();
    this.motion = this.from(orbitOf(frame, this.bounds));
    this.hasMoved = true;
    this.passing = frame;
    this.tell(frame, false);
  }

  /** That way has ended. */
  rest(): void {
    if (this.passing === null) return;
    this.keep();
    this.tell(this.passing);
    this.passing = null;
  }

  /** Tell the server again, which may know nothing of it. */
  tellAgain(): void {
    if (this.hasMoved || this.chosenSize !== null) this.tell(this.frame);
  }

  /** What it sees, or will when it has come to rest. */
  get frame(): Frame {
    return this.hasMoved ? frameOf(this.motion.target) : this.first;
  }

  end(): void {
    this.motion.end();
    leave(this.view.name, false);
  }

  private from(orbit: Orbit): Motion {
    return new Motion(orbit, (shown, isLast) => this.tell(frameOf(shown), isLast));
  }

  private tell({ to_world, yfov }: Frame, isLast = true): void {
    const { name } = this.view;
    const camera = { to_world, yfov: yfov / DEGREES };
    const [width, height] = this.size;
    // what is laid over the picture, as the handles of lights are, follows
    views.value = views.peek().map((other) => (other.name === name ? { ...other, camera, width, height } : other));
    const isPlaced = this.hasMoved || this.chosenSize !== null;
    placeEye(name, isPlaced ? { camera, size: eyeSize(width, height) } : null);
    const isHere = !isLast && drawHere(name);
    if (!isHere) this.say(camera, "exact");
    else if (!isAway(name)) this.say(camera, "stay"); // nothing is to be traced of where it is passing
    leave(name, isHere);
    if (isLast) drawHere(name);
  }

  private say(camera: View["camera"], rest: "exact" | "stay"): void {
    const { name } = this.view;
    this.number = Math.max(this.number + 1, Date.now());
    told(name, this.number);
    send({ type: "eye", view: name, eye: this.number, ...camera, size: eyeSize(...this.size), hand: null, rest });
  }

  private get key(): string {
    return `relume.eye.${scene.peek()?.id}.${this.view.name}`; // other bakes of the scene are seen from there, too
  }

  private keep(): void {
    const kept: Kept = { orbit: this.hasMoved ? this.motion.target : null, size: this.chosenSize };
    try {
      sessionStorage.setItem(this.key, JSON.stringify(kept));
    } catch {
      // storage is full or forbidden: a reload then goes back to where it began
    }
  }

  private read(): Kept {
    try {
      const { orbit, size } = JSON.parse(sessionStorage.getItem(this.key) ?? "{}") as Partial<Kept>;
      const isSize = Array.isArray(size) && size.length === 2 && size.every((side) => Number.isInteger(side) && side > 0);
      return { orbit: orbit && isNear(orbit, orbit) ? orbit : null, size: isSize ? size : null };
    } catch {
      return { orbit: null, size: null };
    }
  }
}

interface Kept {
  orbit: Orbit | null;
  size: Size | null;
}

const eyes = new Map<string, Eye>();

/** The eye of a shown view; null where that was baked from one place. */
export function eyeOf(name: string): Eye | null {
  const of = bake.peek();
  const view = views.peek().find((other) => other.name === name);
  if (of === null || view?.eye !== "free") return null;
  const known = eyes.get(name);
  if (known?.bake === of) return known;
  known?.end();
  const made = new Eye(of, view);
  eyes.set(name, made);
  return made;
}

/** From where a view is seen now; null where it was baked from one place. */
export function cameraOf(name: string): Frame | null {
  const view = views.peek().find((other) => other.name === name);
  return view?.eye === "free" ? { to_world: view.camera.to_world, yfov: view.camera.yfov * DEGREES } : null;
}

/** See a view from there, if its eye moves, in a picture of a size; null: as large as was baked, undefined: as it is. */
export function lookFrom(name: string, camera: Frame, size?: Size | null): void {
  const eye = eyeOf(name);
  if (size !== undefined) eye?.resize(size);
  eye?.change(() => orbitOf(camera, eye.bounds));
}

/** From where views are seen whose eyes move, by name, and how large somebody made their pictures. */
export interface Seen {
  eyes: Record<string, Frame>;
  sizes: Record<string, Size>;
}

/** Of the shown views; those that were baked from one place have none. */
export function seenNow(): Seen {
  const [eyes, sizes]: [Record<string, Frame>, Record<string, Size>] = [{}, {}];
  for (const name of shownViews.value) {
    const [camera, size] = [cameraOf(name), eyeOf(name)?.chosen ?? null];
    if (camera !== null) eyes[name] = camera;
    if (size !== null) sizes[name] = size;
  }
  return { eyes, sizes };
}

/** See views from there; an eye that is there already stays as it is. */
export function seeFrom({ eyes, sizes }: Seen): void {
  const now = seenNow();
  const of = (seen: Seen, name: string) => JSON.stringify([seen.eyes[name], seen.sizes[name]]);
  for (const [name, camera] of Object.entries(eyes)) {
    if (of({ eyes, sizes }, name) !== of(now, name)) lookFrom(name, camera, sizes[name] ?? null);
  }
}

effect(() => {
  if (connection.value !== "open" || bake.value === null) return;
  for (const name of shownViews.value) eyeOf(name)?.tellAgain();
});
