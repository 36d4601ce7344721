/** The border between image and inspector: drag it, or move it with keys. */
import { inspectorWidth } from "../state/panels";
import { INSPECTOR_RANGE, inspectorShownWidth, clampInspectorWidth } from "../state/panelWidths";
import { useDrag } from "./drag";

const STEP = 24;

function resizePanel(width: number): void {
  inspectorWidth.value = clampInspectorWidth(window.innerWidth, width);
}

export function Splitter() {
  const drag = useDrag({
    begin: (event) => event.button === 0,
    move: (event) => resizePanel(window.innerWidth - event.clientX),
  });
  const key = (event: KeyboardEvent) => {
    const step = { ArrowLeft: STEP, ArrowRight: -STEP }[event.key];
    if (step === undefined) return;
    resizePanel(inspectorShownWidth.value + step);
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div
      class="splitter"
      role="separator"
      tabIndex={0}
      aria-orientation="vertical"
      aria-label="Inspector width"
      aria-valuemin={INSPECTOR_RANGE.narrowest}
      aria-valuemax={INSPECTOR_RANGE.widest}
      aria-valuenow={inspectorShownWidth.value}
      {...drag}
      onKeyDown={key}
      onDblClick={() => resizePanel(320)}
    />
  );
}
