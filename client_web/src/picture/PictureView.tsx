/** The picture: canvas, what is laid over it, and the pointer's and keys' ways to move in it. */
import { useEffect, useRef, useState } from "preact/hooks";
import { hoveredMaterial, transform, wipe } from "../state/store";
import { select } from "../state/select";
import { showError } from "../ui/toasts";
import { acceptMaterials } from "../library/drop";
import { FalseColourLegend } from "./FalseColourLegend";
import { HistogramView } from "./HistogramView";
import { PictureBar } from "./PictureBar";
import { leavePicture, probeAt } from "./probe";
import { stage } from "./stage";
import { hitAt } from "./hit";
import { pan, zoomAt } from "./transform";
import { Waiting } from "./Waiting";
import { WipeHandle } from "./WipeHandle";

const CLICK_PX = 4;
const PAN_PX = 48;

function useCanvas() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [failure, setFailure] = useState<string | null>(null);
  useEffect(() => {
    const element = canvas.current as HTMLCanvasElement;
    const fit = () => {
      const ratio = window.devicePixelRatio || 1;
      element.width = Math.max(1, Math.round(element.clientWidth * ratio));
      element.height = Math.max(1, Math.round(element.clientHeight * ratio));
      stage.resize(element.clientWidth, element.clientHeight);
    };
    const observer = new ResizeObserver(fit);
    try {
      fit();
      const detach = stage.attach(element);
      const refuse = acceptMaterials(element);
      observer.observe(element);
      return () => {
        observer.disconnect();
        refuse();
        detach();
      };
    } catch (error) {
      setFailure((error as Error).message);
      showError(error);
      return undefined;
    }
  }, []);
  return { canvas, failure };
}

function usePointer() {
  const drag = useRef({ x: 0, y: 0, moved: false, active: false });
  const down = (event: PointerEvent) => {
    if (event.button > 1) return;
    (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
    drag.current = { x: event.clientX, y: event.clientY, moved: false, active: true };
  };
  const move = (event: PointerEvent) => {
    const at = drag.current;
    if (at.active) {
      const [dx, dy] = [event.clientX - at.x, event.clientY - at.y];
      if (!at.moved && Math.hypot(dx, dy) < CLICK_PX) return;
      drag.current = { x: event.clientX, y: event.clientY, moved: true, active: true };
      transform.value = pan(transform.peek(), stage.canvasSize(), dx, dy);
      return;
    }
    const { px, py, material } = hitAt(event.currentTarget as HTMLCanvasElement, event);
    probeAt(px, py);
    hoveredMaterial.value = material;
  };
  const up = (event: PointerEvent) => {
    const { moved, active } = drag.current;
    drag.current.active = false;
    if (!active || moved || event.button !== 0) return;
    const { material } = hitAt(event.currentTarget as HTMLCanvasElement, event);
    if (material !== null) select(material);
  };
  const leave = () => {
    hoveredMaterial.value = null;
    leavePicture();
  };
  return { onPointerDown: down, onPointerMove: move, onPointerUp: up, onPointerLeave: leave };
}

function onKey(event: KeyboardEvent): void {
  const step = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (step === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
  transform.value = pan(
    transform.peek(),
    stage.canvasSize(),
    (step[0] as number) * PAN_PX,
    (step[1] as number) * PAN_PX,
  );
  event.preventDefault();
}

export function PictureView() {
  const { canvas, failure } = useCanvas();
  const pointer = usePointer();
  useEffect(() => {
    const element = canvas.current as HTMLCanvasElement;
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      const { x, y } = hitAt(element, event);
      const lines = event.deltaMode === 1 ? 30 : 1;
      const factor = Math.exp((-event.deltaY * lines * (event.ctrlKey ? 4 : 1)) / 500);
      transform.value = zoomAt(transform.peek(), stage.canvasSize(), factor, x, y);
    };
    // Preact's own wheel listeners are passive, and the page must not scroll
    element.addEventListener("wheel", wheel, { passive: false });
    return () => element.removeEventListener("wheel", wheel);
  }, []);
  return (
    <main class="picture">
      <div class="canvas">
        <canvas
          ref={canvas}
          tabIndex={0}
          role="img"
          aria-label="The picture. Arrow keys pan, plus and minus zoom; choose materials in the list."
          onKeyDown={onKey}
          {...pointer}
        />
        {failure !== null && <p class="failure">{failure}</p>}
        {wipe.value.on && <WipeHandle />}
        <FalseColourLegend />
        <HistogramView />
        <Waiting />
      </div>
      <PictureBar />
    </main>
  );
}
