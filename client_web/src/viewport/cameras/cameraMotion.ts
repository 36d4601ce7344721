/** Damped camera motion: the displayed orbit eases towards the goal. */
import { interpolateOrbits, isClose, type Orbit } from "./orbit";

const EASING_MS = 70; // time constant: 1/e of the distance is left after this
const LONGEST_MS = 50; // no jump after the page was in the background

/** Time since the last step of a motion. A frame may have begun before the event that started the motion. */
export const elapsedMs = (now: number, last: number, longest: number): number =>
  Math.max(0, Math.min(longest, now - last));

export class CameraMotion {
  private goal: Orbit;
  private frame = 0;
  private lastTime = 0;

  /** `show` is called with each intermediate orbit, and with `isLast` at the goal. */
  constructor(
    private displayed: Orbit,
    private readonly show: (orbit: Orbit, isLast: boolean) => void,
    private readonly isLast: () => boolean = () => matchMedia("(prefers-reduced-motion: reduce)").matches,
  ) {
    this.goal = displayed;
  }

  /** The goal. */
  get target(): Orbit {
    return this.goal;
  }

  /** Continue from a placed orbit. */
  change(update: (orbit: Orbit) => Orbit): void {
    this.goal = update(this.goal);
    if (this.frame !== 0) return;
    this.lastTime = performance.now();
    this.frame = requestAnimationFrame((now) => this.step(now));
  }

  /** Reparametrize the current and the goal orbit; nothing moves. */
  replace(update: (orbit: Orbit) => Orbit): void {
    this.displayed = update(this.displayed);
    this.goal = update(this.goal);
  }

  end(): void {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
  }

  private step(now: number): void {
    const fraction = this.isLast() ? 1 : 1 - Math.exp(-elapsedMs(now, this.lastTime, LONGEST_MS) / EASING_MS);
    this.lastTime = Math.max(now, this.lastTime);
    const next = interpolateOrbits(this.displayed, this.goal, fraction);
    const isLast = isClose(next, this.goal);
    this.displayed = isLast ? this.goal : next;
    this.frame = isLast ? 0 : requestAnimationFrame((later) => this.step(later));
    this.show(this.displayed, isLast);
  }
}
