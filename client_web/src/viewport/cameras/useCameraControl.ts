/** Controls of the camera placement viewport: orbit, pan, wheel, pinch, click and keys. */
import { useRef } from "preact/hooks";
import { TouchGestures } from "./touchGestures";
import { dollyOrbit, panOrbit, rotateOrbit, type Bounds, type Orbit } from "./orbit";

type PointerTarget = PointerEvent & { readonly currentTarget: HTMLElement };
type OrbitChange = (by: (orbit: Orbit) => Orbit) => void;

export const RADIANS_PER_PIXEL = Math.PI; // per image height
const WHEEL = 0.0015; // change of log distance per pixel
const LINE_PX = 30;
const CLICK_PX = 4;
const KEY_TURN = Math.PI / 24;
const KEY_SLIDE = 0.05;
const KEY_ZOOM = 0.9;

const ARROWS: Record<string, [across: number, down: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

/** Apply the camera step of a key or button; false for other keys. */
export function orbitKeyStep(change: OrbitChange, bounds: Bounds, key: string, slides: boolean): boolean {
  const arrow = ARROWS[key];
  if (arrow !== undefined) {
    const [across, down] = arrow;
    if (slides) change((orbit) => panOrbit(orbit, -KEY_SLIDE * across, -KEY_SLIDE * down));
    else change((orbit) => rotateOrbit(orbit, KEY_TURN * across, -KEY_TURN * down));
    return true;
  }
  if (key !== "+" && key !== "=" && key !== "-") return false;
  change((orbit) => dollyOrbit(orbit, key === "-" ? 1 / KEY_ZOOM : KEY_ZOOM, bounds));
  return true;
}

/** Distance factor of a wheel turn. */
export const zoomIn = (event: WheelEvent): number =>
  Math.exp(WHEEL * event.deltaY * (event.deltaMode === 1 ? LINE_PX : 1));

/** Event handlers of the image's element. `click` receives fractions of its sides. */
export function useCameraControl(change: OrbitChange, bounds: Bounds, click: (u: number, v: number) => void) {
  const fingers = useRef(new TouchGestures());
  const traveled = useRef(0);

  const move = (event: PointerTarget) => {
    const pinch = fingers.current.move(event);
    if (pinch === null) return;
    const { height } = event.currentTarget.getBoundingClientRect();
    const [across, down] = [pinch.across / height, pinch.down / height];
    traveled.current += Math.hypot(pinch.across, pinch.down) * pinch.count;
    if (pinch.count > 1 || event.shiftKey || (event.buttons & 6) !== 0)
      change((orbit) => panOrbit(orbit, across, down));
    else change((orbit) => rotateOrbit(orbit, -RADIANS_PER_PIXEL * across, RADIANS_PER_PIXEL * down));
    if (pinch.count > 1) change((orbit) => dollyOrbit(orbit, 1 / pinch.spread, bounds));
  };
  const over = (event: PointerTarget) => {
    if (!fingers.current.lift(event) || event.type !== "pointerup") return;
    const box = event.currentTarget.getBoundingClientRect();
    if (fingers.current.count > 0 || event.button !== 0 || traveled.current > CLICK_PX) return;
    click((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  };
  return {
    onPointerDown(event: PointerTarget) {
      if (fingers.current.count === 0) traveled.current = 0;
      fingers.current.press(event);
      event.currentTarget.setPointerCapture(event.pointerId);
      event.currentTarget.focus();
    },
    onPointerMove: move,
    onPointerUp: over,
    onPointerCancel: over,
    onLostPointerCapture: over,
    onContextMenu: (event: Event) => event.preventDefault(),
    onWheel(event: WheelEvent) {
      event.preventDefault();
      change((orbit) => dollyOrbit(orbit, zoomIn(event), bounds));
    },
  };
}
