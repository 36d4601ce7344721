/** Tracks the pointers pressed on an element: pan of their center, and pinch of two of them. */
type ScreenPoint = { x: number; y: number };
type PointerSample = Pick<PointerEvent, "pointerId" | "clientX" | "clientY">;

export interface PinchMove {
  /** Number of pressed pointers. */
  count: number;
  /** Movement of their center, pixels. */
  across: number;
  down: number;
  /** Position of their center. */
  center: ScreenPoint;
  /** Ratio of two pointers' distance to the previous one. */
  spread: number;
}

const midpoint = (points: ScreenPoint[]): ScreenPoint => ({
  x: points.reduce((sum, { x }) => sum + x, 0) / points.length,
  y: points.reduce((sum, { y }) => sum + y, 0) / points.length,
});

const distanceBetween = ([a, b]: ScreenPoint[]): number =>
  a === undefined || b === undefined ? 0 : Math.hypot(a.x - b.x, a.y - b.y);

export class TouchGestures {
  private readonly points = new Map<number, ScreenPoint>();

  get count(): number {
    return this.points.size;
  }

  /** Position of a single pointer; null with none or several. */
  get only(): ScreenPoint | null {
    const [first, second] = [...this.points.values()];
    return second === undefined ? (first ?? null) : null;
  }

  press({ pointerId, clientX, clientY }: PointerSample): void {
    this.points.set(pointerId, { x: clientX, y: clientY });
  }

  /** False if it was not pressed. */
  lift({ pointerId }: PointerSample): boolean {
    return this.points.delete(pointerId);
  }

  /** Update a moved pointer; null if it is not pressed. */
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
