/** Free cameras of views: moved by the user, sent to the server, stored for a reload. */
import { effect } from "@preact/signals";
import { connections, sendToShown } from "../../session/connections";
import { limitRenderSize } from "../../session/clientRenderer";
import { renderIfPossible, isMoving, setMoving } from "../../session/clientRendering";
import { requestPixelProbe } from "../../session/pixelProbe";
import type { HelloMessage, Triple } from "../../protocol";
import { bake } from "../../state/bakes";
import { connection } from "../../state/connection";
import { storeCamera } from "../../state/cameras";
import { scene } from "../../state/scene";
import { shownViews, views } from "../../state/views";
import { CameraMotion } from "./cameraMotion";
import { poseOf, isClose, orbitOf, type Bounds, type CameraPose, type Orbit } from "./orbit";

type View = HelloMessage["views"][number];

const DEGREES = 180 / Math.PI;

export type ViewSize = [width: number, height: number];

/** The free camera of one view of one bake. */
export class FreeCamera {
  readonly first: CameraPose;
  readonly bounds: Bounds;
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
    this.first = { to_world: view.camera.to_world, yfov: view.camera.yfov * DEGREES };
    this.initialOrbit = orbitOf(this.first, this.bounds);
    const { orbit, size } = this.load();
    this.hasMoved = orbit !== null;
    this.sizeOverride = size;
    this.motion = this.createMotion(orbit ?? this.initialOrbit);
  }

  get orbit(): Orbit {
    return this.motion.target;
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

  change = (update: (orbit: Orbit) => Orbit): void => {
    this.hasMoved = true;
    this.playbackPose = null;
    this.motion.change(update);
    this.save();
  };

  /** Orbit around the point in the image's center; if unknown, keep the target. */
  async grab(): Promise<void> {
    const [width, height] = limitRenderSize(...this.size);
    const middle = requestPixelProbe(this.view.name, Math.floor(width / 2), Math.floor(height / 2));
    const position = await middle.then((answer) => answer.position, () => null);
    if (position !== null) this.motion.replace((orbit) => orbitOf(poseOf(orbit), this.bounds, position));
  }

  /** Focus on a point. */
  lookAt(target: Triple): void {
    this.change((now) => ({ ...now, target }));
  }

  /** Return to the initial camera, which may look straight down, unlike an orbit. */
  restart(): void {
    this.motion.end();
    this.motion = this.createMotion(this.initialOrbit);
    this.hasMoved = false;
    this.save();
    this.report(this.first);
  }

  /** Move to a playback pose. */
  play(playedPose: CameraPose): void {
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
    this.motion.end();
    setMoving(this.view.name, false);
  }

  private createMotion(orbit: Orbit): CameraMotion {
    return new CameraMotion(orbit, (displayed, isLast) => this.report(poseOf(displayed), isLast));
  }

  private report({ to_world, yfov }: CameraPose, isLast = true): void {
    const { name } = this.view;
    const camera = { to_world, yfov: yfov / DEGREES };
    const [width, height] = this.size;
    // overlays such as light handles follow
    views.value = views.peek().map((current) => (current.name === name ? { ...current, camera, width, height } : current));
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
    sendToShown({ type: "camera", view: name, seq: this.number, ...camera, size: limitRenderSize(...this.size), active_control: null, refine });
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
      const { orbit, size } = JSON.parse(sessionStorage.getItem(this.key) ?? "{}") as { orbit?: Orbit | null; size?: number[] | null };
      const isSize = Array.isArray(size) && size.length === 2 && size.every((side) => Number.isInteger(side) && side > 0);
      return { orbit: orbit && isClose(orbit, orbit) ? orbit : null, size: isSize ? (size as StoredCamera["size"]) : null };
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
  return view?.camera_mode === "free" ? { to_world: view.camera.to_world, yfov: view.camera.yfov * DEGREES } : null;
}

/** Move a view's camera, if it is free, and set its image size; null: the baked size, undefined: unchanged. */
export function moveFreeCamera(name: string, camera: CameraPose, size?: ViewSize | null): void {
  const freeCamera = freeCameraOf(name);
  if (size !== undefined) freeCamera?.resize(size);
  freeCamera?.change(() => orbitOf(camera, freeCamera.bounds));
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
