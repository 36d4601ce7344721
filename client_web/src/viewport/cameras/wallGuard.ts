/** Stops a moving camera at surfaces. Poses wait until the server has traced the path to them, one request at a time. */
import type { PathBody, Triple } from "../../protocol";
import { add, dot, length, normalize, scale, subtract } from "../../panels/lights/vector";
import { interpolateOrbits, positionOf, translateOrbit, type Orbit } from "./orbit";

/** The first surface on a path; with its normal. */
export type Obstacle = Pick<PathBody, "length" | "material" | "normal">;

/** A surface that has stopped the camera. */
export interface Wall {
  material: string;
  /** The direction in which the camera moved. */
  direction: Triple;
}

const MAX_TURN = 0.05; // radians between points of a path
const MAX_POINTS = 62; // per request
const MIN_COSINE = 0.1; // at more grazing angles, the camera comes nearer than the margin
const MIN_SLIDE = 0.2; // fraction of a stopped movement; less is a stop

interface Guarded {
  /** The pose now. */
  now: () => Orbit;
  accept: (orbit: Orbit) => void;
  /** Called when a surface has stopped the camera. */
  stop: (wall: Wall) => void;
  /** The first surface on a path, meters. */
  trace: (points: Triple[]) => Promise<Obstacle>;
}

interface Waypoint {
  orbit: Orbit;
  /** Length of the path up to here. */
  length: number;
}

/** Orbits on the way through `poses`, with little rotation between two. */
function waypointsOf(poses: readonly Orbit[]): Waypoint[] {
  const way: Waypoint[] = [{ orbit: poses[0] as Orbit, length: 0 }];
  for (const pose of poses.slice(1)) {
    const { orbit: from } = way.at(-1) as Waypoint;
    const turn = Math.max(Math.abs(pose.azimuth - from.azimuth), Math.abs(pose.elevation - from.elevation));
    const count = Math.min(MAX_POINTS, Math.max(1, Math.ceil(turn / MAX_TURN)));
    for (let k = 1; k <= count; k++) {
      const last = way.at(-1) as Waypoint;
      const orbit = k === count ? pose : interpolateOrbits(from, pose, k / count);
      way.push({ orbit, length: last.length + length(subtract(positionOf(orbit), positionOf(last.orbit))) });
    }
  }
  return way;
}

/** The pose after a length of the path. */
function poseAfter(way: readonly Waypoint[], traveled: number): Orbit {
  const next = way.findIndex((waypoint) => waypoint.length > traveled);
  if (next < 0) return (way.at(-1) as Waypoint).orbit;
  const [a, b] = [way[Math.max(0, next - 1)] as Waypoint, way[next] as Waypoint];
  let [low, high] = [0, 1]; // the distance to the target changes by factors, so that lengths are not linear in this
  for (let step = 0; step < 24; step++) {
    const middle = (low + high) / 2;
    const moved = length(subtract(positionOf(interpolateOrbits(a.orbit, b.orbit, middle)), positionOf(a.orbit)));
    if (moved < traveled - a.length) low = middle;
    else high = middle;
  }
  return interpolateOrbits(a.orbit, b.orbit, low);
}

/** The poses that fit into one request, at least one. */
function countThatFits(from: Orbit, poses: readonly Orbit[]): number {
  let count = 1;
  while (count < poses.length && waypointsOf([from, ...poses.slice(0, count + 1)]).length <= MAX_POINTS) count++;
  return count;
}

export class WallGuard {
  private waiting: { orbit: Orbit; slides: boolean }[] = [];
  private isBusy = false;

  /** `margin`: least distance from surfaces, meters. */
  constructor(
    private readonly margin: number,
    private readonly guarded: Guarded,
  ) {}

  /** The pose to which the camera is moving. */
  get goal(): Orbit {
    return this.waiting.at(-1)?.orbit ?? this.guarded.now();
  }

  /** Move to a pose, or as far as nothing is in the way. `slides`: then continue along the surface. */
  move(orbit: Orbit, slides = false): void {
    this.waiting.push({ orbit, slides });
    if (!this.isBusy) void this.run();
  }

  /** Forget the poses that wait. */
  cancel(): void {
    this.waiting = [];
  }

  private async run(): Promise<void> {
    this.isBusy = true;
    while (this.waiting.length > 0) {
      const from = this.guarded.now();
      const count = countThatFits(from, this.waiting.map(({ orbit }) => orbit)); // prettier-ignore
      const step = this.waiting.slice(0, count);
      const way = waypointsOf([from, ...step.map(({ orbit }) => orbit)]);
      const obstacle = await this.trace(way);
      if (this.waiting[0] !== step[0]) continue; // canceled meanwhile
      if (obstacle?.length != null)
        this.halt(
          way,
          obstacle,
          step.some(({ slides }) => slides),
        );
      else {
        this.waiting.splice(0, count);
        this.guarded.accept((way.at(-1) as Waypoint).orbit);
      }
    }
    this.isBusy = false;
  }

  /** The first surface within a margin of the way; null if nothing moves, or without an answer. */
  private async trace(way: readonly Waypoint[]): Promise<Obstacle | null> {
    const points = way.map(({ orbit }) => positionOf(orbit));
    if ((way.at(-1) as Waypoint).length < 1e-9) return null;
    const end = points.at(-1) as Triple;
    const extended = [...points, add(end, scale(lastDirection(points), this.margin))];
    return this.guarded.trace(extended).catch(() => null); // without a server, nothing holds the camera
  }

  /** Stop a margin before a surface, and slide along it. */
  private halt(way: readonly Waypoint[], { length: traveled, material, normal }: Obstacle, slides: boolean): void {
    const points = way.map(({ orbit }) => positionOf(orbit));
    const passed = way.filter((waypoint) => waypoint.length < (traveled as number)).length;
    const direction = lastDirection(points.slice(0, passed + 1));
    const towards = normal === null ? 1 : Math.abs(dot(direction, normal));
    const stopped = poseAfter(way, Math.max(0, (traveled as number) - this.margin / Math.max(MIN_COSINE, towards)));
    const rest = subtract(points.at(-1) as Triple, positionOf(stopped));
    const goal = this.goal; // what was turned meanwhile stays
    const held = slides ? translateOrbit(goal, subtract(positionOf(stopped), positionOf(goal))) : stopped;
    this.cancel();
    this.guarded.accept(held);
    const along = normal === null ? rest : subtract(rest, scale(normal, dot(rest, normal)));
    if (slides && length(along) > MIN_SLIDE * length(rest)) this.move(translateOrbit(held, along));
    else this.guarded.stop({ material: material ?? "", direction });
  }
}

/** The direction in which a path ends. */
function lastDirection(points: readonly Triple[]): Triple {
  const end = points.at(-1) as Triple;
  const previous = [...points].reverse().find((point) => length(subtract(end, point)) > 0) ?? end;
  return normalize(subtract(end, previous));
}
