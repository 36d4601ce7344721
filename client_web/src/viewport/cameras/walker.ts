/** Moves a camera while walking keys are held. */
import { add, length, scale } from "../../panels/lights/vector";
import type { Triple } from "../../protocol";
import { elapsedMs } from "./cameraMotion";
import { walkSpeed, type Steerable } from "./navigation";
import { walkOrbit } from "./orbit";

/** Direction of each key, by its position on the keyboard: right, up, forward. */
const DIRECTIONS: Record<string, Triple> = {
  KeyW: [0, 0, 1],
  KeyS: [0, 0, -1],
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};
const FAST = 4; // with Shift
const LONGEST_MS = 100; // no jump after the page was in the background

type WalkingKey = Pick<KeyboardEvent, "code" | "shiftKey">;

export class Walker {
  private readonly held = new Set<string>();
  private isFast = false;
  private frame = 0;
  private lastTime = 0;

  /** `isLevel`: walk along the floor; else fly along the view direction. */
  constructor(
    private readonly camera: () => Steerable | null,
    private readonly isLevel: () => boolean,
  ) {}

  /** False for other keys. */
  press({ code, shiftKey }: WalkingKey): boolean {
    if (DIRECTIONS[code] === undefined) return false;
    this.held.add(code);
    this.isFast = shiftKey;
    if (this.frame !== 0) return true;
    this.lastTime = performance.now();
    this.frame = requestAnimationFrame((now) => this.step(now));
    return true;
  }

  release({ code, shiftKey }: WalkingKey): void {
    this.held.delete(code);
    this.isFast = shiftKey;
  }

  stop(): void {
    this.held.clear();
  }

  private step(now: number): void {
    const camera = this.camera();
    this.frame = this.held.size > 0 && camera !== null ? requestAnimationFrame((later) => this.step(later)) : 0;
    const direction = [...this.held].reduce<Triple>((sum, code) => add(sum, DIRECTIONS[code] as Triple), [0, 0, 0]);
    const seconds = elapsedMs(now, this.lastTime, LONGEST_MS) / 1000;
    this.lastTime = Math.max(now, this.lastTime);
    if (camera === null || length(direction) === 0) return;
    const meters = (walkSpeed(camera.bounds) * (this.isFast ? FAST : 1) * seconds) / length(direction);
    const isLevel = this.isLevel();
    camera.change((orbit) => walkOrbit(orbit, scale(direction, meters), isLevel), true);
  }
}
