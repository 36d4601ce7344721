/** The eyes of views that move: where hands have put them, told to the server, kept over a reload. */
import { effect } from "@preact/signals";
import { send } from "../live/connections";
import { drawHere, eyeSize, isAway, leave, told } from "../live/drawing";
import { askProbe } from "../live/probing";
import type { HelloMessage, Triple } from "../protocol";
import { bake } from "../state/bakes";
import { connection } from "../state/connection";
import { shownViews, views } from "../state/views";
import { Motion } from "./motion";
import { frameOf, isNear, orbitOf, type Bounds, type Frame, type Orbit } from "./orbit";

type View = HelloMessage["views"][number];

const DEGREES = 180 / Math.PI;

/** Of one view of one bake. */
export class Eye {
  readonly first: Frame;
  readonly bounds: Bounds;
  private readonly begun: Orbit;
  private motion: Motion;
  private number = 0;
  private hasMoved = false;

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
    const kept = this.read();
    this.hasMoved = kept !== null;
    this.motion = this.from(kept ?? this.begun);
  }

  get orbit(): Orbit {
    return this.motion.target;
  }

  /** Whether it is where it began. */
  get isFirst(): boolean {
    return !this.hasMoved;
  }

  change = (by: (orbit: Orbit) => Orbit): void => {
    this.hasMoved = true;
    this.motion.change(by);
    this.keep();
  };

  /** From now on turn about what the middle of the picture shows. */
  async grasp(): Promise<void> {
    const { width, height, name } = this.view;
    const { position } = await askProbe(name, Math.floor(width / 2), Math.floor(height / 2));
    if (position !== null) this.motion.restate((orbit) => orbitOf(frameOf(orbit), this.bounds, position as Triple));
  }

  /** Look at a place. */
  lookAt(place: Triple): void {
    this.change((now) => ({ ...now, target: place }));
  }

  /** Go back to where it began; its first camera may have been tilted, which no orbit is. */
  restart(): void {
    this.motion.end();
    this.motion = this.from(this.begun);
    this.hasMoved = false;
    sessionStorage.removeItem(this.key);
    this.tell(this.first);
  }

  /** Tell the server again, which may know nothing of it. */
  tellAgain(): void {
    if (this.hasMoved) this.tell(frameOf(this.motion.target));
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
    // what is laid over the picture, as the handles of lights are, follows
    views.value = views.peek().map((other) => (other.name === name ? { ...other, camera } : other));
    const isHere = !isLast && drawHere(name);
    if (!isHere) this.say(camera, "exact");
    else if (!isAway(name)) this.say(camera, "stay"); // nothing is to be traced of where it is passing
    leave(name, isHere);
    if (isLast) drawHere(name);
  }

  private say(camera: View["camera"], rest: "exact" | "stay"): void {
    const { name, width, height } = this.view;
    this.number = Math.max(this.number + 1, Date.now());
    told(name, this.number);
    send({ type: "eye", view: name, eye: this.number, ...camera, size: eyeSize(width, height), hand: null, rest });
  }

  private get key(): string {
    return `relume.eye.${this.bake}.${this.view.name}`;
  }

  private keep(): void {
    sessionStorage.setItem(this.key, JSON.stringify(this.motion.target));
  }

  private read(): Orbit | null {
    try {
      const kept = JSON.parse(sessionStorage.getItem(this.key) ?? "null") as Orbit | null;
      return kept !== null && isNear(kept, kept) ? kept : null;
    } catch {
      return null;
    }
  }
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

/** See a view from there, if its eye moves. */
export function lookFrom(name: string, camera: Frame): void {
  const eye = eyeOf(name);
  eye?.change(() => orbitOf(camera, eye.bounds));
}

effect(() => {
  if (connection.value !== "open" || bake.value === null) return;
  for (const name of shownViews.value) eyeOf(name)?.tellAgain();
});
