/** Fingers, or a pointer, that are down on an element: how far a move took what is under them, and how far two of them
 * spread it. */
type Place = { x: number; y: number };
type Pointed = Pick<PointerEvent, "pointerId" | "clientX" | "clientY">;

export interface Pull {
  /** How many are down. */
  count: number;
  /** How far the middle of them went, pixels. */
  across: number;
  down: number;
  /** Where the middle of them is. */
  middle: Place;
  /** How many times as far apart two of them are as before. */
  spread: number;
}

const middleOf = (points: Place[]): Place => ({
  x: points.reduce((sum, { x }) => sum + x, 0) / points.length,
  y: points.reduce((sum, { y }) => sum + y, 0) / points.length,
});

const apart = ([a, b]: Place[]): number => (a === undefined || b === undefined ? 0 : Math.hypot(a.x - b.x, a.y - b.y));

export class Fingers {
  private readonly places = new Map<number, Place>();

  get count(): number {
    return this.places.size;
  }

  /** Where it is, of one; null of none or several. */
  get only(): Place | null {
    const [place, other] = [...this.places.values()];
    return other === undefined ? (place ?? null) : null;
  }

  press({ pointerId, clientX, clientY }: Pointed): void {
    this.places.set(pointerId, { x: clientX, y: clientY });
  }

  /** False where it was not down. */
  lift({ pointerId }: Pointed): boolean {
    return this.places.delete(pointerId);
  }

  /** One of them has moved; null where it is not down. */
  move({ pointerId, clientX, clientY }: Pointed): Pull | null {
    if (!this.places.has(pointerId)) return null;
    const before = [...this.places.values()];
    this.places.set(pointerId, { x: clientX, y: clientY });
    const after = [...this.places.values()];
    const [from, to, wide] = [middleOf(before), middleOf(after), apart(before)];
    const spread = wide > 0 && apart(after) > 0 ? apart(after) / wide : 1;
    return { count: after.length, across: to.x - from.x, down: to.y - from.y, middle: to, spread };
  }
}
