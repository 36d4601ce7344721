/** One view: its canvas, what is laid over it, and the pointer's and keys' ways to move in it. */
import { useEffect, useRef, useState } from "preact/hooks";
import { eyeOf } from "../cameras/eye";
import { approached } from "../cameras/orbit";
import { nearer, step } from "../cameras/useHand";
import { Pins } from "../comments/Pins";
import { acceptImages } from "../images/drop";
import { acceptMaterials } from "../library/drop";
import { LightHandles } from "../lights/LightHandles";
import { askProbe } from "../live/probing";
import { hitAt } from "../picture/hit";
import { Screen } from "../picture/screen";
import { stage } from "../picture/stage";
import { zoomAt } from "../picture/transform";
import { moveTo, transformOf } from "../picture/viewTransforms";
import type { Triple } from "../protocol";
import { wipe } from "../state/display";
import { scene } from "../state/scene";
import { showAlone, sideBySide, viewName, views, workIn } from "../state/views";
import { attempt, showError } from "../ui/toasts";
import { Waiting } from "./Waiting";
import { WipeHandle } from "./WipeHandle";
import { panBy, usePointer } from "./usePointer";

const PAN_PX = 48;

function onWheel(screen: Screen, event: WheelEvent): void {
  event.preventDefault();
  const { view } = screen.picture;
  const eye = eyeOf(view);
  if (eye !== null && !event.ctrlKey) return eye.change((orbit) => approached(orbit, nearer(event), eye.bounds));
  const { x, y } = hitAt(screen, event);
  const lines = event.deltaMode === 1 ? 30 : 1;
  const factor = Math.exp((-event.deltaY * lines * (event.ctrlKey ? 4 : 1)) / 500);
  moveTo(view, zoomAt(transformOf(view), screen.size(), factor, x, y));
}

/** Keep the screen as large as its canvas, and take what is not the framework's to hear; returns how to stop. */
function connect(screen: Screen): () => void {
  const { canvas } = screen;
  const fit = () => {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    screen.resize(canvas.clientWidth, canvas.clientHeight);
  };
  const observer = new ResizeObserver(fit);
  const wheel = (event: WheelEvent) => onWheel(screen, event);
  const refusals = [acceptMaterials(screen), acceptImages(screen)];
  fit();
  observer.observe(canvas);
  // Preact's own wheel listeners are passive, and the page must not scroll
  canvas.addEventListener("wheel", wheel, { passive: false });
  return () => {
    observer.disconnect();
    canvas.removeEventListener("wheel", wheel);
    for (const refuse of refusals) refuse();
    screen.close();
  };
}

/** The screen of a canvas, once there is one; it shows the picture of `view`. */
function useScreen(view: string) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [screen, setScreen] = useState<Screen | null>(null);
  const [failure, setFailure] = useState<string | null>(null);
  useEffect(() => {
    try {
      const made = new Screen(canvas.current as HTMLCanvasElement, stage.of(view));
      setScreen(made);
      return connect(made);
    } catch (error) {
      setFailure((error as Error).message);
      showError(error);
      return undefined;
    }
  }, []);
  const picture = stage.of(view);
  useEffect(() => {
    if (screen !== null && screen.picture !== picture) screen.take(picture);
  }, [screen, picture]);
  return { canvas, screen, failure };
}

/** Look at what a pixel shows; beside others, the view is shown alone first. */
async function onDoubleClick(screen: Screen, view: string, event: MouseEvent): Promise<void> {
  const eye = eyeOf(view);
  if (sideBySide.peek() || eye === null) return sideBySide.peek() ? showAlone(view) : undefined;
  const { px, py } = hitAt(screen, event);
  const { position } = await askProbe(view, px, py);
  if (position !== null) eye.lookAt(position as Triple);
}

function onKey(screen: Screen, event: KeyboardEvent): void {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const eye = eyeOf(screen.picture.view);
  if (eye !== null && event.key === "Home") return (eye.restart(), event.preventDefault());
  if (eye !== null && event.key !== "Enter") {
    if (step(eye.change, eye.bounds, event.key, event.shiftKey)) {
      event.preventDefault();
      event.stopPropagation();
    }
    return;
  }
  const pans = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (pans !== undefined) panBy(screen, (pans[0] as number) * PAN_PX, (pans[1] as number) * PAN_PX);
  else if (event.key === "Enter" && sideBySide.value) showAlone(screen.picture.view);
  else return;
  event.preventDefault();
}

/** The view's name, which also says where the hand works; a press shows the view alone. */
function Name({ view }: { view: string }) {
  return (
    <button
      class="cell-name"
      title={`Show “${view}” alone (double-click in the picture, or Enter)`}
      onClick={() => showAlone(view)}
    >
      {view}
    </button>
  );
}

export function Cell({ view }: { view: string }) {
  scene.value; // another scene has other pictures, also under the same name
  const { canvas, screen, failure } = useScreen(view);
  const pointer = usePointer(screen, view);
  const beside = sideBySide.value;
  const moves = views.value.find(({ name }) => name === view)?.eye === "free";
  const label = beside ? `The view ${view}. Enter shows it alone.` : "The picture.";
  return (
    <div class={`cell ${beside && view === viewName.value ? "active" : ""}`}>
      <canvas
        ref={canvas}
        tabIndex={0}
        role="img"
        aria-label={`${label} ${moves ? "Arrow keys turn the eye, with Shift they slide it, plus and minus go nearer and farther, Home goes back" : "Arrow keys pan, plus and minus zoom"}; choose materials in the list.`}
        onKeyDown={(event) => screen !== null && onKey(screen, event)}
        onFocus={() => workIn(view)}
        onDblClick={(event) => screen !== null && void attempt(() => onDoubleClick(screen, view, event))}
        onContextMenu={(event) => eyeOf(view) !== null && event.preventDefault()}
        {...pointer}
      />
      {failure !== null && <p class="failure">{failure}</p>}
      {screen?.isLost.value === true && (
        <p class="failure" role="status">
          The browser took the graphics memory away. The picture returns with it, or when you reload the page; nothing of
          your work is lost.
        </p>
      )}
      {screen !== null && <LightHandles screen={screen} />}
      {screen !== null && <Pins screen={screen} />}
      {wipe.value.on && screen !== null && <WipeHandle screen={screen} />}
      <Waiting picture={stage.of(view)} />
      {beside && <Name view={view} />}
    </div>
  );
}
