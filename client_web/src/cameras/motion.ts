/** Damping: what is shown follows what hands ask for, and comes to rest on it. */
import { between, isNear, type Orbit } from "./orbit";

const SETTLE_MS = 70; // a third of the way is left after this
const LONGEST_MS = 50; // a page that was in the background makes no leap

export class Motion {
  private wanted: Orbit;
  private frame = 0;
  private before = 0;

  /** `show` is called with each orbit on the way; `isLast` with the one that hands asked for. */
  constructor(
    private shown: Orbit,
    private readonly show: (orbit: Orbit, isLast: boolean) => void,
    private readonly isStill: () => boolean = () => matchMedia("(prefers-reduced-motion: reduce)").matches,
  ) {
    this.wanted = shown;
  }

  /** Where it goes. */
  get target(): Orbit {
    return this.wanted;
  }

  /** Go on from where the hand has put it. */
  change(by: (orbit: Orbit) => Orbit): void {
    this.wanted = by(this.wanted);
    if (this.frame !== 0) return;
    this.before = performance.now();
    this.frame = requestAnimationFrame((now) => this.step(now));
  }

  /** Describe where it is and where it goes otherwise; nothing moves. */
  restate(by: (orbit: Orbit) => Orbit): void {
    this.shown = by(this.shown);
    this.wanted = by(this.wanted);
  }

  end(): void {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
  }

  private step(now: number): void {
    const share = this.isStill() ? 1 : 1 - Math.exp(-Math.min(LONGEST_MS, now - this.before) / SETTLE_MS);
    this.before = now;
    const next = between(this.shown, this.wanted, share);
    const isLast = isNear(next, this.wanted);
    this.shown = isLast ? this.wanted : next;
    this.frame = isLast ? 0 : requestAnimationFrame((later) => this.step(later));
    this.show(this.shown, isLast);
  }
}
