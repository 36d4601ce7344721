/** Over a view's image while lights are matched: the brush, and the current stroke. */
import { useState } from "preact/hooks";
import type { ImageCanvas } from "../../../render/canvas";
import { transformOf } from "../../../render/viewTransforms";
import { displayedWidth, toImagePoint, toScreenPoint } from "../../../render/zoomTransform";
import { displayedFrames } from "../../../state/display";
import { useDrag } from "../../../ui/drag";
import { beginStroke, brushRadius, endStroke, extendStroke, gesture, type ImagePoint } from "./match";

export function MatchBrush({ screen }: { screen: ImageCanvas }) {
  void displayedFrames.value;
  const [pointer, setPointer] = useState<{ x: number; y: number } | null>(null);
  const { view, pixels } = screen.image;
  const transform = transformOf(view);
  const size = screen.size();
  const pixelsPerScreen = pixels.width / displayedWidth(transform, size);
  const imagePoint = (event: PointerEvent): ImagePoint => {
    const box = screen.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    setPointer({ x, y });
    const [u, v] = toImagePoint(transform, size, x, y);
    return [u * pixels.width, v * pixels.height];
  };
  const drag = useDrag({
    begin(event) {
      if (event.button !== 0) return false;
      beginStroke(view, imagePoint(event), brushRadius.peek() * pixelsPerScreen);
      return true;
    },
    move: (event) => extendStroke(imagePoint(event)),
    hover: (event) => void imagePoint(event),
    end: endStroke,
  });
  const current = gesture.value?.view === view ? gesture.value : null;
  const line = (current?.points ?? []).map(([x, y]) =>
    toScreenPoint(transform, size, x / pixels.width, y / pixels.height).join(" "),
  );
  return (
    <div
      class="match-brush"
      {...drag}
      onPointerLeave={() => setPointer(null)}
      onWheel={(event) => screen.canvas.dispatchEvent(new WheelEvent("wheel", event))}
    >
      <svg aria-hidden="true">
        {current !== null && line.length > 0 && (
          <path
            class="stroke"
            d={`M${line.join("L")}${line.length === 1 ? `L${line[0]}` : ""}`}
            stroke-width={(2 * current.radius) / pixelsPerScreen}
          />
        )}
        {pointer !== null && <circle cx={pointer.x} cy={pointer.y} r={brushRadius.value} />}
      </svg>
    </div>
  );
}
