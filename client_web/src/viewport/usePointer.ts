/** Pointer and touch navigation in an image, or of its free camera. */
import { useRef } from "preact/hooks";
import { freeCameraOf } from "./cameras/freeCamera";
import { TouchGestures, type PinchMove } from "./cameras/touchGestures";
import { dollyOrbit, panOrbit } from "./cameras/orbit";
import { dragCamera } from "./cameras/useCameraControl";
import { placePin } from "../panels/collaboration/commentActions";
import { placeLightAt, placingKind } from "../panels/lights/placement";
import { makeGray } from "../panels/looks/whiteBalance";
import { requestPixelProbe } from "../session/pixelProbe";
import { pickMaterial } from "../render/materialPicking";
import type { ImageCanvas } from "../render/canvas";
import { panTransform, zoomAt } from "../render/zoomTransform";
import { setTransform, transformOf } from "../render/viewTransforms";
import { areaBetween, isAreaProbeOn, probedArea } from "../state/areaProbe";
import { isPickingGray } from "../state/display";
import { pendingPin } from "../state/comments";
import { hoveredMaterial, selectMaterial } from "../state/selection";
import { hoveredView } from "../state/views";
import { useDrag } from "../ui/drag";
import { clearProbe, probeAt } from "./pixelReadout";

type ViewPointerTarget = PointerEvent & { readonly currentTarget: Element };

const CLICK_PX = 4;
const RIGHT_BUTTON = 2;

export function panView(screen: ImageCanvas, dx: number, dy: number): void {
  const { view } = screen.image;
  setTransform(view, panTransform(transformOf(view), screen.size(), dx, dy));
}

/** Select the material of a pixel; in free-camera views the server picks it. */
async function selectAt(view: string, x: number, y: number): Promise<void> {
  const { material } = await requestPixelProbe(view, x, y);
  if (material !== null) selectMaterial(material);
}

/** Two fingers pan and pinch. */
function pinchCamera(screen: ImageCanvas, view: string, { across, down, center, spread }: PinchMove): void {
  const freeCamera = freeCameraOf(view);
  if (freeCamera === null) {
    const box = screen.canvas.getBoundingClientRect();
    panView(screen, across, down);
    return setTransform(
      view,
      zoomAt(transformOf(view), screen.size(), spread, center.x - box.left, center.y - box.top),
    );
  }
  clearProbe();
  const { height } = screen.size();
  freeCamera.change((orbit) =>
    dollyOrbit(panOrbit(orbit, across / height, down / height), 1 / spread, freeCamera.bounds),
  );
}

/** `isRightHeld`: set while the right button is held. */
export function useViewPointer(screen: ImageCanvas | null, view: string, isRightHeld: { current: boolean }) {
  const drag = useRef({ x: 0, y: 0, moved: false });
  const areaStart = useRef<[number, number] | null>(null);
  const begin = (event: PointerEvent) => {
    areaStart.current = null;
    if (isAreaProbeOn.peek() && event.button === 0 && screen !== null) {
      const { px, py } = pickMaterial(screen, event);
      areaStart.current = [px, py];
      return true;
    }
    drag.current = { x: event.clientX, y: event.clientY, moved: false };
    const freeCamera = freeCameraOf(view);
    void freeCamera?.grab();
    isRightHeld.current = event.button === RIGHT_BUTTON;
    return event.button <= (freeCamera === null ? 1 : 2);
  };
  const move = (event: PointerEvent) => {
    if (screen === null) return;
    hoveredView.value = view;
    if (areaStart.current !== null) {
      const { px, py } = pickMaterial(screen, event);
      const { width, height } = screen.image.pixels;
      probedArea.value = areaBetween(areaStart.current, [px, py], [width, height]);
      return;
    }
    const { x, y, moved } = drag.current;
    const [dx, dy] = [event.clientX - x, event.clientY - y];
    if (!moved && Math.hypot(dx, dy) < CLICK_PX) return;
    drag.current = { x: event.clientX, y: event.clientY, moved: true };
    const freeCamera = freeCameraOf(view);
    if (freeCamera === null) return panView(screen, dx, dy);
    clearProbe(); // the probed point has moved away from the pointer
    const { height } = screen.size();
    dragCamera(freeCamera, event, dx / height, dy / height);
  };
  const hover = (event: PointerEvent) => {
    if (screen === null) return;
    hoveredView.value = view; // not on enter: the view under an idle pointer may change
    const { px, py, material } = pickMaterial(screen, event);
    probeAt(screen.image, px, py);
    hoveredMaterial.value = material;
  };
  const end = (event: PointerEvent, released: boolean) => {
    isRightHeld.current = false;
    if (screen === null || !released || drag.current.moved || event.button !== 0) return;
    const { px, py, material } = pickMaterial(screen, event);
    if (isPickingGray.peek()) makeGray(screen.image.radiance(px, py));
    else if (placingKind.peek() !== null) void placeLightAt(view, px, py);
    else if (pendingPin.peek() !== null) placePin(view, px, py);
    else if (freeCameraOf(view) !== null) void selectAt(view, px, py);
    else if (material !== null) selectMaterial(material);
  };
  const onLeave = () => {
    hoveredView.value = hoveredMaterial.value = null;
    clearProbe();
  };
  const dragHandlers = useDrag({ begin, move, hover, end });
  const fingers = useRef(new TouchGestures());
  const lift = (event: PointerEvent) => {
    const { current } = fingers;
    const left = current.lift(event) ? current.only : null;
    if (left !== null) drag.current = { ...left, moved: true }; // continue with the remaining finger
  };
  return {
    ...dragHandlers,
    onPointerLeave: onLeave,
    onPointerDown(event: ViewPointerTarget) {
      if (event.pointerType === "touch") fingers.current.press(event);
      dragHandlers.onPointerDown(event);
    },
    onPointerMove(event: ViewPointerTarget) {
      const pull = fingers.current.move(event);
      if (screen === null || pull === null || pull.count < 2) return dragHandlers.onPointerMove(event);
      drag.current.moved = true; // not a click
      return pinchCamera(screen, view, pull);
    },
    onPointerUp: (event: ViewPointerTarget) => (lift(event), dragHandlers.onPointerUp(event)),
    onPointerCancel: (event: ViewPointerTarget) => (lift(event), dragHandlers.onPointerCancel(event)),
  };
}
