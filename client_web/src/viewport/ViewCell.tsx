/** One view: its canvas, overlays, and pointer and keyboard navigation. */
import { useEffect, useRef, useState } from "preact/hooks";
import { freeCameraOf } from "./cameras/freeCamera";
import { navigation } from "./cameras/navigation";
import { dollyOrbit } from "./cameras/orbit";
import { cameraKeyStep, zoomIn } from "./cameras/useCameraControl";
import { Walker } from "./cameras/walker";
import { CommentPins } from "../panels/collaboration/CommentPins";
import { acceptImageDrops } from "../panels/inspector/images/dropImages";
import { acceptMaterialDrops } from "../panels/library/dropMaterial";
import { LightHandles } from "../panels/lights/LightHandles";
import { MatchBrush } from "../panels/lights/match/MatchBrush";
import { isMatchOpen } from "../state/match";
import { requestPixelProbe } from "../session/pixelProbe";
import { pickMaterial } from "../render/materialPicking";
import { ImageCanvas } from "../render/canvas";
import { stage } from "../render/renderStage";
import { zoomAt } from "../render/zoomTransform";
import { setTransform, transformOf } from "../render/viewTransforms";
import { wipe } from "../state/display";
import { scene } from "../state/scene";
import { showSingleView, sideBySide, activeViewName, views, setFocus } from "../state/views";
import { reportErrors, showError, showNote } from "../ui/toasts";
import { AreaFrame } from "./AreaProbe";
import { BusyOverlay } from "./BusyOverlay";
import { WipeHandle } from "./WipeHandle";
import { panView, useViewPointer } from "./usePointer";

const PAN_PX = 48;
const KEYS = {
  orbit: "Arrow keys: orbit. Shift+arrows: pan. Plus and minus: dolly. Home: reset view. O: walk.",
  walk: "W A S D: walk. Q and E: down and up. Arrow keys: turn and step. Plus and minus: dolly. Home: reset view. O: orbit.",
};

/** Keys of the camera, such as Home, follow a turn of the wheel. */
function focusUnlessTyping(canvas: HTMLCanvasElement): void {
  if (document.activeElement?.matches("input, textarea, select, [contenteditable]") !== true)
    canvas.focus({ preventScroll: true });
}

function onWheel(screen: ImageCanvas, event: WheelEvent): void {
  event.preventDefault();
  const { view } = screen.image;
  const freeCamera = freeCameraOf(view);
  if (freeCamera !== null && !event.ctrlKey) {
    focusUnlessTyping(screen.canvas);
    freeCamera.beginDolly();
    return freeCamera.change((orbit) => dollyOrbit(orbit, zoomIn(event), freeCamera.bounds));
  }
  const { x, y } = pickMaterial(screen, event);
  const lines = event.deltaMode === 1 ? 30 : 1;
  const factor = Math.exp((-event.deltaY * lines * (event.ctrlKey ? 4 : 1)) / 500);
  setTransform(view, zoomAt(transformOf(view), screen.size(), factor, x, y));
}

/** Keep the screen at its canvas's size, and add native event listeners; returns a cleanup function. */
function connectScreen(screen: ImageCanvas): () => void {
  const { canvas } = screen;
  const fit = () => {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    screen.resize(canvas.clientWidth, canvas.clientHeight);
  };
  const observer = new ResizeObserver(fit);
  const wheel = (event: WheelEvent) => onWheel(screen, event);
  const rejections = [acceptMaterialDrops(screen), acceptImageDrops(screen)];
  fit();
  observer.observe(canvas);
  // Preact's own wheel listeners are passive, and the page must not scroll
  canvas.addEventListener("wheel", wheel, { passive: false });
  return () => {
    observer.disconnect();
    canvas.removeEventListener("wheel", wheel);
    for (const rejectContextMenu of rejections) rejectContextMenu();
    screen.close();
  };
}

/** The screen of a mounted canvas; it shows the image of `view`. */
function useScreen(view: string) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const image = stage.imageOf(view);
  const firstImage = useRef(image);
  const [screen, setScreen] = useState<ImageCanvas | null>(null);
  const [failure, setFailure] = useState<string | null>(null);
  useEffect(() => {
    try {
      const createdScreen = new ImageCanvas(canvas.current as HTMLCanvasElement, firstImage.current);
      setScreen(createdScreen);
      return connectScreen(createdScreen);
    } catch (error) {
      setFailure((error as Error).message);
      showError(error);
      return undefined;
    }
  }, []);
  useEffect(() => {
    if (screen !== null && screen.image !== image) screen.setImage(image);
  }, [screen, image]);
  return { canvas, screen, failure };
}

/** Zoom to a pixel or focus the camera on it; in the grid, show the view alone first. */
async function onDoubleClick(screen: ImageCanvas, view: string, event: MouseEvent): Promise<void> {
  const freeCamera = freeCameraOf(view);
  if (sideBySide.peek() || freeCamera === null) return sideBySide.peek() ? showSingleView(view) : undefined;
  screen.canvas.focus({ preventScroll: true });
  const { px, py } = pickMaterial(screen, event);
  const { position } = await requestPixelProbe(view, px, py);
  if (position !== null) freeCamera.lookAt(position);
  else showNote("There is only background here. Double-click a surface to focus on it.");
  return undefined;
}

/** Walking keys act while the camera walks, or while the right button is held. */
function useWalker(view: string, isRightHeld: { current: boolean }): Walker {
  const shown = useRef(view);
  shown.current = view;
  const walker = useRef<Walker | null>(null);
  const isWalking = () => navigation.peek() === "walk";
  walker.current ??= new Walker(
    () => (isWalking() || isRightHeld.current ? freeCameraOf(shown.current) : null),
    isWalking,
  );
  useEffect(() => () => walker.current?.stop(), []);
  return walker.current;
}

function onViewKey(screen: ImageCanvas, walker: Walker, isRightHeld: boolean, event: KeyboardEvent): void {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const freeCamera = freeCameraOf(screen.image.view);
  if (freeCamera !== null && event.key === "Home") return (freeCamera.restart(), event.preventDefault());
  if (freeCamera !== null && event.key !== "Enter") {
    const walks = (navigation.peek() === "walk" || isRightHeld) && walker.press(event);
    if (walks || cameraKeyStep(freeCamera, event.key, event.shiftKey)) {
      event.preventDefault();
      event.stopPropagation();
    }
    return;
  }
  const pans = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (pans !== undefined) panView(screen, (pans[0] as number) * PAN_PX, (pans[1] as number) * PAN_PX);
  else if (event.key === "Enter" && sideBySide.value) showSingleView(screen.image.view);
  else return;
  event.preventDefault();
}

/** The view's name, which also marks the active view; a press shows the view alone. */
function ViewName({ view }: { view: string }) {
  return (
    <button
      class="cell-name"
      title={`Show only “${view}” (double-click or Enter)`}
      onClick={() => showSingleView(view)}
    >
      {view}
    </button>
  );
}

export function ViewCell({ view }: { view: string }) {
  void scene.value; // another scene may have a view of the same name
  const { canvas, screen, failure } = useScreen(view);
  const isRightHeld = useRef(false);
  const pointer = useViewPointer(screen, view, isRightHeld);
  const walker = useWalker(view, isRightHeld);
  const isGrid = sideBySide.value;
  const moves = views.value.find(({ name }) => name === view)?.camera_mode === "free";
  const label = isGrid ? `View ${view}. Enter: show alone.` : "Picture.";
  return (
    <div class={`cell ${isGrid && view === activeViewName.value ? "active" : ""}`}>
      <canvas
        ref={canvas}
        tabIndex={0}
        role="img"
        aria-label={`${label} ${moves ? KEYS[navigation.value] : "Arrow keys: pan. Plus and minus: zoom."} Select materials in the list.`}
        onKeyDown={(event) => screen !== null && onViewKey(screen, walker, isRightHeld.current, event)}
        onKeyUp={(event) => walker.release(event)}
        onBlur={() => walker.stop()}
        onFocus={() => setFocus(view)}
        onDblClick={(event) => screen !== null && void reportErrors(() => onDoubleClick(screen, view, event))}
        onContextMenu={(event) => freeCameraOf(view) !== null && event.preventDefault()}
        {...pointer}
      />
      {failure !== null && <p class="failure">{failure}</p>}
      {screen?.isLost.value === true && (
        <p class="failure" role="status">
          The browser lost its graphics context. Your work is safe; the picture returns automatically or when you reload
          the page.
        </p>
      )}
      {screen !== null && <LightHandles screen={screen} />}
      {screen !== null && <AreaFrame screen={screen} />}
      {screen !== null && <CommentPins screen={screen} />}
      {isMatchOpen.value && screen !== null && <MatchBrush screen={screen} />}
      {wipe.value.isOn && screen !== null && <WipeHandle screen={screen} />}
      <BusyOverlay image={stage.imageOf(view)} />
      {isGrid && <ViewName view={view} />}
    </div>
  );
}
