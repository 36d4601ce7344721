/** The line between A (left) and the live image B (right): drag it, or move it with keys. */
import { useRef } from "preact/hooks";
import type { ImageCanvas } from "../render/canvas";
import { displayedWidth, toScreenPoint } from "../render/zoomTransform";
import { transformOf } from "../render/viewTransforms";
import { displayedFrames, wipe } from "../state/display";
import { useDrag } from "../ui/drag";

const STEP = 0.02;

function setWipe(position: number): void {
  wipe.value = { isOn: true, position: Math.min(1, Math.max(0, position)) };
}

export function WipeHandle({ screen }: { screen: ImageCanvas }) {
  void displayedFrames.value;
  const size = screen.size();
  const { position } = wipe.value;
  const transform = transformOf(screen.image.view);
  const [x] = toScreenPoint(transform, size, position, 0);
  const startPosition = useRef(0);
  const drag = useDrag({
    begin(event) {
      startPosition.current = event.clientX;
      return event.button === 0;
    },
    move(event) {
      const dx = event.clientX - startPosition.current;
      startPosition.current = event.clientX;
      setWipe(wipe.peek().position + dx / displayedWidth(transform, size));
    },
  });
  const key = (event: KeyboardEvent) => {
    const step = STEP * (event.shiftKey ? 0.1 : 1);
    const next = { ArrowLeft: position - step, ArrowRight: position + step, Home: 0, End: 1 }[event.key];
    if (next === undefined) return;
    setWipe(next);
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div
      class="wipe"
      role="slider"
      tabIndex={0}
      aria-label="Wipe between A and B (live)"
      aria-valuemin={0}
      aria-valuemax={100}
      aria-valuenow={Math.round(position * 100)}
      style={{ left: `${x}px` }}
      {...drag}
      onKeyDown={key}
    >
      <span class="side a">A</span>
      <span class="knob" />
      <span class="side b">B</span>
    </div>
  );
}
