/** The line between A (left) and B, the live picture (right): drag it, or move it by keys. */
import { useRef } from "preact/hooks";
import type { Screen } from "../picture/screen";
import { shownWidth, toScreen } from "../picture/transform";
import { transformOf } from "../picture/viewTransforms";
import { drawn, wipe } from "../state/display";
import { useDrag } from "../ui/drag";

const STEP = 0.02;

function moveTo(at: number): void {
  wipe.value = { on: true, at: Math.min(1, Math.max(0, at)) };
}

export function WipeHandle({ screen }: { screen: Screen }) {
  drawn.value;
  const size = screen.size();
  const { at } = wipe.value;
  const transform = transformOf(screen.picture.view);
  const [x] = toScreen(transform, size, at, 0);
  const before = useRef(0);
  const hand = useDrag({
    begin(event) {
      before.current = event.clientX;
      return event.button === 0;
    },
    move(event) {
      const dx = event.clientX - before.current;
      before.current = event.clientX;
      moveTo(wipe.peek().at + dx / shownWidth(transform, size));
    },
  });
  const key = (event: KeyboardEvent) => {
    const step = STEP * (event.shiftKey ? 0.1 : 1);
    const next = { ArrowLeft: at - step, ArrowRight: at + step, Home: 0, End: 1 }[event.key];
    if (next === undefined) return;
    moveTo(next);
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div
      class="wipe"
      role="slider"
      tabIndex={0}
      aria-label="Wipe between A and B, the live picture"
      aria-valuemin={0}
      aria-valuemax={100}
      aria-valuenow={Math.round(at * 100)}
      style={{ left: `${x}px` }}
      {...hand}
      onKeyDown={key}
    >
      <span class="side a">A</span>
      <span class="knob" />
      <span class="side b">B</span>
    </div>
  );
}
