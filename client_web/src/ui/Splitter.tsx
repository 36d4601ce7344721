/** The border between picture and inspector: drag it, or move it by keys. */
import { inspectorWidth } from "../state/panels";

const NARROWEST = 288;
const WIDEST = 720;
const STEP = 24;

function resize(width: number): void {
  inspectorWidth.value = Math.round(Math.min(WIDEST, Math.max(NARROWEST, Math.min(width, window.innerWidth * 0.55))));
}

export function Splitter() {
  const move = (event: PointerEvent) => {
    if ((event.currentTarget as HTMLElement).hasPointerCapture(event.pointerId))
      resize(window.innerWidth - event.clientX);
  };
  const key = (event: KeyboardEvent) => {
    const step = { ArrowLeft: STEP, ArrowRight: -STEP }[event.key];
    if (step === undefined) return;
    resize(inspectorWidth.value + step);
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div
      class="splitter"
      role="separator"
      tabIndex={0}
      aria-orientation="vertical"
      aria-label="Width of the inspector"
      aria-valuemin={NARROWEST}
      aria-valuemax={WIDEST}
      aria-valuenow={inspectorWidth.value}
      onPointerDown={(event) => event.currentTarget.setPointerCapture(event.pointerId)}
      onPointerMove={move}
      onKeyDown={key}
      onDblClick={() => resize(320)}
    />
  );
}
