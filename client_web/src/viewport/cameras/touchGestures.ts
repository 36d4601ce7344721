/** Fingers, or a pointer, that are down on an element: how far a move took what is under them, and how far two of them
 * spread it. */
type ScreenPoint = { x: number; y: number };
type PointerSample = Pick<PointerEvent, "pointerId" | "clientX" | "clientY">;

export interface PinchMove {
  /** How many are down. */
  count: number;
  /** How far the middle of them went, pixels. */
  across: number;
  down: number;
  /** Where the middle of them is. */
  center: ScreenPoint;
  /** How many times as far apart two of them are as before. */
  spread: number;
}

const midpoint = (points: ScreenPoint[]): ScreenPoint => ({
  x: points.reduce((sum, { x }) => sum + x, 0) / points.length,
  y: points.reduce((sum, { y }) => sum + y, 0) / points.length,
});

const distanceBetween = ([a, b]: ScreenPoint[]): number => (a === undefined || b === undefined ? 0 : Math.hypot(a.x - b.x, a.y - b.y));

export class TouchGestures {
  private readonly points = new Map<number, ScreenPoint>();

  get count(): number {
    return this.points.size;
  }

  /** Where it is, of one; null of none or several. */
  get only(): ScreenPoint | null {
    const [first, second] = [...this.points.values()];
    return second === undefined ? (first ?? null) : null;
  }

  press({ pointerId, clientX, clientY }: PointerSample): void {
    this.points.set(pointerId, { x: clientX, y: clientY });
  }

  /** False where it was not down. */
  lift({ pointerId }: PointerSample): boolean {
    return this.points.delete(pointerId);
  }

  /** One of them has moved; null where it is not down. */
  move({ pointerId, clientX, clientY }: PointerSample): PinchMove | null {
    if (!this.points.has(pointerId)) return null;
    const previous = [...this.points.values()];
    this.points.set(pointerId, { x: clientX, y: clientY });
    const after = [...this.points.values()];
    const [from, to, wide] = [midpoint(previous), midpoint(after), distanceBetween(previous)];
    const spread = wide > 0 && distanceBetween(after) > 0 ? distanceBetween(after) / wide : 1;
    return { count: after.length, across: to.x - from.x, down: to.y - from.y, center: to, spread };
  }
}
