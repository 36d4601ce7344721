/** Free cameras of views: moved by the user, sent to the server, stored for a reload. */
import { effect } from "@preact/signals";
import { connections, sendToShown } from "../../session/connections";
import { limitRenderSize } from "../../session/clientRenderer";
import { renderIfPossible, isMoving, setMoving } from "../../session/clientRendering";
import { tracePath } from "../../session/pathTracing";
import { requestPixelProbe } from "../../session/pixelProbe";
import type { HelloMessage, Triple } from "../../protocol";
import { bake } from "../../state/bakes";
import { connection } from "../../state/connection";
import { isCameraMoving, storeCamera } from "../../state/cameras";
import { scene } from "../../state/scene";
import { shownViews, views } from "../../state/views";
import { length, scale, subtract, add } from "../../panels/lights/vector";
import { showError, showNote } from "../../ui/toasts";
import { CameraMotion } from "./cameraMotion";
import { stopsAtWalls, wallMargin, type Steerable } from "./navigation";
import {
  diagonalOf,
  forwardOf,
  isClose,
  orbitOf,
  poseOf,
  positionOf,
  translateOrbit,
  type Bounds,
  type CameraPose,
  type Orbit,
} from "./orbit";
import { WallGuard, type Wall } from "./wallGuard";

type View = HelloMessage["views"][number];

const DEGREES = 180 / Math.PI;
const GESTURE_MS = 800; // changes closer together are one step of Back
const MAX_PREVIOUS = 50;
const MAX_LAYERS = 8; // surfaces of a wall to step through

export type ViewSize = [width: number, height: number];

const toDegrees = ({ to_world, yfov, near }: View["camera"]): CameraPose => ({ to_world, yfov: yfov * DEGREES, near });

/** The free camera of one view of one bake. */
export class FreeCamera implements Steerable {
  readonly first: CameraPose;
  readonly bounds: Bounds;
  /** A camera in the scene's largest room; null if nothing is enclosed. */
  readonly interior: CameraPose | null;
  private readonly guard: WallGuard;
  /** Poses before each gesture, for Back. */
  private previous: Orbit[] = [];
  private lastChange = -Infinity;
  /** The surface that has stopped the camera, until it moves on. */
  private wall: Wall | null = null;
  private readonly initialOrbit: Orbit;
  private motion: CameraMotion;
  private number = 0;
  private hasMoved = false;
  /** Pose during playback. */
  private playbackPose: CameraPose | null = null;
  /** Chosen image size; null: the baked size. */
  private sizeOverride: ViewSize | null = null;

  constructor(
    readonly bake: string,
    private readonly view: View,
  ) {
    const [lowest, highest] = view.bounds ?? [
      [0, 0, 0],
      [1, 1, 1],
    ];
    this.bounds = { lowest: lowest as Triple, highest: highest as Triple };
    this.first = toDegrees(view.camera);
    this.interior = view.interior_camera ? toDegrees(view.interior_camera) : null;
    this.initialOrbit = orbitOf(this.first, this.bounds);
    const { orbit, size } = this.load();
    this.hasMoved = orbit !== null;
    this.sizeOverride = size;
    this.motion = this.createMotion(orbit ?? this.initialOrbit);
    this.guard = new WallGuard(wallMargin(this.bounds), {
      now: () => this.motion.target,
      accept: (accepted) => this.moveTo(() => accepted),
      stop: (wall) => this.onWall(wall),
      trace: tracePath,
    });
  }

  get orbit(): Orbit {
    return this.guard.goal;
  }

  /** True if the camera was elsewhere before. */
  get hasPrevious(): boolean {
    return this.previous.length > 0;
  }

  /** The chosen image size, if any. */
  get customSize(): ViewSize | null {
    return this.sizeOverride;
  }

  get size(): ViewSize {
    return this.sizeOverride ?? [this.view.width, this.view.height];
  }

  /** Set the image size; null: the baked size. */
  resize(size: ViewSize | null): void {
    this.sizeOverride = size;
    this.save();
    this.report(this.pose);
  }

  /** Move as far as no wall is in the way. */
  change = (update: (orbit: Orbit) => Orbit, slides = false): void => {
    this.remember();
    if (stopsAtWalls.peek()) this.guard.move(update(this.guard.goal), slides);
    else this.moveTo(update);
  };

  /** Move through anything, as to a saved camera. */
  jump(update: (orbit: Orbit) => Orbit): void {
    this.lastChange = -Infinity; // a step of its own
    this.remember();
    this.lastChange = -Infinity;
    this.guard.cancel();
    this.moveTo(update);
    void this.reportSolid();
  }

  /** Return to where the camera was before the last gesture. */
  goBack(): void {
    const pose = this.previous.pop();
    if (pose === undefined) return showNote("There is no previous camera.");
    this.guard.cancel();
    this.lastChange = -Infinity;
    return this.moveTo(() => pose);
  }

  /** Move into the scene's largest room. */
  goInside(): void {
    const { interior } = this;
    if (interior === null) return showNote("No place in this scene is enclosed by surfaces.");
    return this.jump(() => orbitOf(interior, this.bounds));
  }

  /** Move behind the wall that has stopped the camera, else behind the surface in front of it. */
  async stepThrough(): Promise<void> {
    const [from, gap] = [positionOf(this.orbit), 2 * wallMargin(this.bounds)];
    const direction = this.wall?.direction ?? forwardOf(this.orbit);
    const reach = scale(direction, 2 * diagonalOf(this.bounds) + length(from));
    let position = from;
    for (let layer = 0; layer < MAX_LAYERS; layer++) {
      const { length: free } = await tracePath([position, add(position, reach)]);
      if (free === null) break;
      position = add(position, scale(direction, free + gap));
      if ((await tracePath([position, position])).solid === null) break; // otherwise inside the wall
    }
    if (position === from) return showNote("No surface is in front of the camera.");
    this.wall = null;
    return this.jump((orbit) => translateOrbit(orbit, subtract(position, from)));
  }

  /** Orbit around the point in the image's center; if unknown, keep the target. */
  async grab(): Promise<void> {
    const [width, height] = limitRenderSize(...this.size);
    const middle = requestPixelProbe(this.view.name, Math.floor(width / 2), Math.floor(height / 2));
    const position = await middle.then(
      (answer) => answer.position,
      () => null,
    );
    if (position !== null) this.motion.replace((orbit) => orbitOf(poseOf(orbit), this.bounds, position));
  }

  /** Before a turn of the wheel: dolly towards the point in the image's center. */
  beginDolly(): void {
    if (performance.now() - this.lastChange > GESTURE_MS) void this.grab();
  }

  /** Focus on a point. */
  lookAt(target: Triple): void {
    this.change((now) => ({ ...now, target }));
  }

  /** Return to the initial camera, which may look straight down, unlike an orbit. */
  restart(): void {
    this.lastChange = -Infinity;
    this.remember();
    this.lastChange = -Infinity;
    this.guard.cancel();
    this.motion.end();
    this.motion = this.createMotion(this.initialOrbit);
    this.hasMoved = false;
    this.save();
    this.report(this.first);
  }

  /** Move to a playback pose. */
  play(playedPose: CameraPose): void {
    this.guard.cancel();
    this.motion.end();
    this.motion = this.createMotion(orbitOf(playedPose, this.bounds));
    this.hasMoved = true;
    this.playbackPose = playedPose;
    this.report(playedPose, false);
  }

  /** End the playback motion. */
  stop(): void {
    if (this.playbackPose === null) return;
    this.save();
    this.report(this.playbackPose);
    this.playbackPose = null;
  }

  /** Send the camera again, as after a reconnection. */
  resend(): void {
    if (this.hasMoved || this.sizeOverride !== null) this.report(this.pose);
  }

  /** The current pose, or the pose where it will stop. */
  get pose(): CameraPose {
    return this.hasMoved ? poseOf(this.motion.target) : this.first;
  }

  end(): void {
    this.guard.cancel();
    this.motion.end();
    setMoving(this.view.name, false);
    isCameraMoving.value = false;
  }

  private moveTo(update: (orbit: Orbit) => Orbit): void {
    this.hasMoved = true;
    this.playbackPose = null;
    this.wall = null;
    this.motion.change(update);
    this.save();
  }

  /** Store the pose before a gesture. */
  private remember(): void {
    const [now, before] = [performance.now(), this.lastChange];
    this.lastChange = now;
    if (now - before > GESTURE_MS) this.previous = [...this.previous, this.motion.target].slice(-MAX_PREVIOUS);
  }

  private onWall(wall: Wall): void {
    this.wall = wall;
    const run = () => void this.stepThrough().catch(showError);
    showNote(`“${wall.material}” stops the camera.`, { label: "Step through", run });
  }

  /** Tell if the camera is inside a closed surface, where little can be visible. */
  private async reportSolid(): Promise<void> {
    const position = positionOf(this.motion.target);
    const solid = await tracePath([position, position]).then(
      (answer) => answer.solid,
      () => null,
    );
    if (solid === null) return;
    showNote(`The camera is inside “${solid}” and shows its inner side.`, { label: "Back", run: () => this.goBack() });
  }

  private createMotion(orbit: Orbit): CameraMotion {
    return new CameraMotion(orbit, (displayed, isLast) => this.report(poseOf(displayed), isLast));
  }

  private report({ to_world, yfov, near = 0 }: CameraPose, isLast = true): void {
    const { name } = this.view;
    const camera = { to_world, yfov: yfov / DEGREES, near };
    isCameraMoving.value = !isLast;
    if (isLast && !stopsAtWalls.peek()) void this.reportSolid();
    const [width, height] = this.size;
    // overlays such as light handles follow
    views.value = views
      .peek()
      .map((current) => (current.name === name ? { ...current, camera, width, height } : current));
    const hasOwnPose = this.hasMoved || this.sizeOverride !== null;
    storeCamera(name, hasOwnPose ? { camera, size: limitRenderSize(width, height) } : null);
    const isRenderedHere = !isLast && renderIfPossible(name);
    if (!isRenderedHere) this.sendPose(camera, "exact");
    else if (!isMoving(name)) this.sendPose(camera, "none"); // intermediate poses need no exact image
    setMoving(name, isRenderedHere);
    if (isLast) renderIfPossible(name);
  }

  private sendPose(camera: View["camera"], refine: "exact" | "none"): void {
    const { name } = this.view;
    this.number = Math.max(this.number + 1, Date.now());
    connections.shown?.cameraSeqs.set(name, this.number);
    sendToShown({
      type: "camera",
      view: name,
      seq: this.number,
      ...camera,
      size: limitRenderSize(...this.size),
      active_control: null,
      refine,
    });
  }

  private get key(): string {
    return `relume.camera.${scene.peek()?.id}.${this.view.name}`; // shared by all bakes of the scene
  }

  private save(): void {
    const stored: StoredCamera = { orbit: this.hasMoved ? this.motion.target : null, size: this.sizeOverride };
    try {
      sessionStorage.setItem(this.key, JSON.stringify(stored));
    } catch {
      // storage is full or forbidden: a reload starts at the initial camera
    }
  }

  private load(): StoredCamera {
    try {
      const { orbit, size } = JSON.parse(sessionStorage.getItem(this.key) ?? "{}") as {
        orbit?: Orbit | null;
        size?: number[] | null;
      };
      const isSize =
        Array.isArray(size) && size.length === 2 && size.every((side) => Number.isInteger(side) && side > 0);
      return {
        orbit: orbit && isClose(orbit, orbit) ? orbit : null, // not one of an older version, without some number
        size: isSize ? (size as StoredCamera["size"]) : null,
      };
    } catch {
      return { orbit: null, size: null };
    }
  }
}

interface StoredCamera {
  orbit: Orbit | null;
  size: ViewSize | null;
}

const freeCameras = new Map<string, FreeCamera>();

/** The free camera of a shown view; null with a fixed camera. */
export function freeCameraOf(name: string): FreeCamera | null {
  const currentBakeId = bake.peek();
  const view = views.peek().find((candidate) => candidate.name === name);
  if (currentBakeId === null || view?.camera_mode !== "free") return null;
  const existing = freeCameras.get(name);
  if (existing?.bake === currentBakeId) return existing;
  existing?.end();
  const created = new FreeCamera(currentBakeId, view);
  freeCameras.set(name, created);
  return created;
}

/** Current pose of a view; null with a fixed camera. */
export function cameraOf(name: string): CameraPose | null {
  const view = views.peek().find((candidate) => candidate.name === name);
  return view?.camera_mode === "free" ? toDegrees(view.camera) : null;
}

/** Move a view's camera, if it is free, and set its image size; null: the baked size, undefined: unchanged. */
export function moveFreeCamera(name: string, camera: CameraPose, size?: ViewSize | null): void {
  const freeCamera = freeCameraOf(name);
  if (size !== undefined) freeCamera?.resize(size);
  freeCamera?.jump(() => orbitOf(camera, freeCamera.bounds));
}

/** Poses of free-camera views, by name, and their chosen image sizes. */
export interface CameraSet {
  poses: Record<string, CameraPose>;
  sizes: Record<string, ViewSize>;
}

/** Cameras of the shown views with a free camera. */
export function currentCameras(): CameraSet {
  const [poses, sizes]: [Record<string, CameraPose>, Record<string, ViewSize>] = [{}, {}];
  for (const name of shownViews.value) {
    const [camera, size] = [cameraOf(name), freeCameraOf(name)?.customSize ?? null];
    if (camera !== null) poses[name] = camera;
    if (size !== null) sizes[name] = size;
  }
  return { poses, sizes };
}

/** Move the views' cameras; a camera already there is left unchanged. */
export function applyCameras({ poses, sizes }: CameraSet): void {
  const current = currentCameras();
  const keyOf = (cameras: CameraSet, name: string) => JSON.stringify([cameras.poses[name], cameras.sizes[name]]);
  for (const [name, camera] of Object.entries(poses)) {
    if (keyOf({ poses, sizes }, name) !== keyOf(current, name)) moveFreeCamera(name, camera, sizes[name] ?? null);
  }
}

effect(() => {
  if (connection.value !== "open" || bake.value === null) return;
  for (const name of shownViews.value) freeCameraOf(name)?.resend();
});
