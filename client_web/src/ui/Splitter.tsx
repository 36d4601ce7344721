/** The border between picture and inspector: drag it, or move it by keys. */
import { inspectorWidth } from "../state/panels";
import { INSPECTOR, inspectorShownWidth, inspectorWidthIn } from "../state/room";
import { useDrag } from "./drag";

const STEP = 24;

function resize(width: number): void {
  inspectorWidth.value = inspectorWidthIn(window.innerWidth, width);
}

export function Splitter() {
  const hand = useDrag({
    begin: (event) => event.button === 0,
    move: (event) => resize(window.innerWidth - event.clientX),
  });
  const key = (event: KeyboardEvent) => {
    const step = { ArrowLeft: STEP, ArrowRight: -STEP }[event.key];
    if (step === undefined) return;
    resize(inspectorShownWidth.value + step);
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
      aria-valuemin={INSPECTOR.narrowest}
      aria-valuemax={INSPECTOR.widest}
      aria-valuenow={inspectorShownWidth.value}
      {...hand}
      onKeyDown={key}
      onDblClick={() => resize(320)}
    />
  );
}
