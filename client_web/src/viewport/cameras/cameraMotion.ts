/** Damped camera motion: the displayed orbit follows the goal, and stops on it. */
import { interpolateOrbits, isClose, type Orbit } from "./orbit";

const EASING_MS = 70; // a third of the way is left after this
const LONGEST_MS = 50; // a page that was in the background makes no leap

export class CameraMotion {
  private goal: Orbit;
  private frame = 0;
  private lastTime = 0;

  /** `show` is called with each orbit on the way; `isLast` with the goal. */
  constructor(
    private displayed: Orbit,
    private readonly show: (orbit: Orbit, isLast: boolean) => void,
    private readonly isLast: () => boolean = () => matchMedia("(prefers-reduced-motion: reduce)").matches,
  ) {
    this.goal = displayed;
  }

  /** Where it goes. */
  get target(): Orbit {
    return this.goal;
  }

  /** Go on from where it was placed. */
  change(update: (orbit: Orbit) => Orbit): void {
    this.goal = update(this.goal);
    if (this.frame !== 0) return;
    this.lastTime = performance.now();
    this.frame = requestAnimationFrame((now) => this.step(now));
  }

  /** Describe where it is and where it goes otherwise; nothing moves. */
  replace(update: (orbit: Orbit) => Orbit): void {
    this.displayed = update(this.displayed);
    this.goal = update(this.goal);
  }

  end(): void {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
  }

  private step(now: number): void {
    const fraction = this.isLast() ? 1 : 1 - Math.exp(-Math.min(LONGEST_MS, now - this.lastTime) / EASING_MS);
    this.lastTime = now;
    const next = interpolateOrbits(this.displayed, this.goal, fraction);
    const isLast = isClose(next, this.goal);
    this.displayed = isLast ? this.goal : next;
    this.frame = isLast ? 0 : requestAnimationFrame((later) => this.step(later));
    this.show(this.displayed, isLast);
  }
}
