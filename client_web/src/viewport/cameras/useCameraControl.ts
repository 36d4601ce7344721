/** Camera gestures, and the controls of the camera placement viewport: drag, pan, wheel, pinch, click and keys. */
import { useRef } from "preact/hooks";
import { navigation, walkStep, type Steerable } from "./navigation";
import { TouchGestures } from "./touchGestures";
import { dollyOrbit, panOrbit, rotateOrbit, turnHead, walkOrbit } from "./orbit";

type PointerTarget = PointerEvent & { readonly currentTarget: HTMLElement };

const RADIANS_PER_PIXEL = Math.PI; // per image height
const WHEEL = 0.0015; // change of log distance per pixel
const LINE_PX = 30;
const CLICK_PX = 4;
const KEY_TURN = Math.PI / 24;
const KEY_SLIDE = 0.05;
const KEY_ZOOM = 0.9;
const RIGHT_BUTTON = 2;
const MIDDLE_BUTTON = 4;

const ARROWS: Record<string, [across: number, down: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

/** An arrow in orbit mode: orbit, or pan. */
function orbitStep({ change }: Steerable, across: number, down: number, isShift: boolean): void {
  if (isShift) change((orbit) => panOrbit(orbit, -KEY_SLIDE * across, -KEY_SLIDE * down), true);
  else change((orbit) => rotateOrbit(orbit, KEY_TURN * across, -KEY_TURN * down));
}

/** An arrow in walk mode: turn or step; with Shift step aside, or look up and down. */
function walkArrow({ change, bounds }: Steerable, across: number, down: number, isShift: boolean): void {
  const meters = walkStep(bounds);
  if ((across === 0) === isShift) change((orbit) => turnHead(orbit, -KEY_TURN * across, KEY_TURN * down));
  else change((orbit) => walkOrbit(orbit, [meters * across, 0, -meters * down], true), true);
}

/** Apply the camera step of a key or button; false for other keys. */
export function cameraKeyStep(camera: Steerable, key: string, isShift: boolean): boolean {
  const arrow = ARROWS[key];
  if (arrow !== undefined) {
    (navigation.peek() === "walk" ? walkArrow : orbitStep)(camera, ...arrow, isShift);
    return true;
  }
  if (key !== "+" && key !== "=" && key !== "-") return false;
  camera.change((orbit) => dollyOrbit(orbit, key === "-" ? 1 / KEY_ZOOM : KEY_ZOOM, camera.bounds));
  return true;
}

/** Move a camera with a dragged pointer, by fractions of the image's height: orbit, pan, or look around. */
export function dragCamera({ change }: Steerable, event: PointerEvent, across: number, down: number): void {
  if (event.shiftKey || (event.buttons & MIDDLE_BUTTON) !== 0)
    return change((orbit) => panOrbit(orbit, across, down), true);
  if (navigation.peek() === "orbit" && (event.buttons & RIGHT_BUTTON) === 0)
    return change((orbit) => rotateOrbit(orbit, -RADIANS_PER_PIXEL * across, RADIANS_PER_PIXEL * down));
  // a mouse turns the head, a finger pulls the picture
  const sign = event.pointerType === "touch" ? -1 : 1;
  return change((orbit) => {
    const angle = (sign * orbit.yfov * Math.PI) / 180;
    return turnHead(orbit, -angle * across, angle * down);
  });
}

/** Distance factor of a wheel turn. */
export const zoomIn = (event: WheelEvent): number =>
  Math.exp(WHEEL * event.deltaY * (event.deltaMode === 1 ? LINE_PX : 1));

/** Event handlers of the image's element. `click` receives fractions of its sides. */
export function useCameraControl(camera: Steerable, click: (u: number, v: number) => void) {
  const fingers = useRef(new TouchGestures());
  const traveled = useRef(0);

  const move = (event: PointerTarget) => {
    const pinch = fingers.current.move(event);
    if (pinch === null) return;
    const { height } = event.currentTarget.getBoundingClientRect();
    const [across, down] = [pinch.across / height, pinch.down / height];
    traveled.current += Math.hypot(pinch.across, pinch.down) * pinch.count;
    if (pinch.count === 1) return dragCamera(camera, event, across, down);
    camera.change((orbit) => dollyOrbit(panOrbit(orbit, across, down), 1 / pinch.spread, camera.bounds));
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
      camera.change((orbit) => dollyOrbit(orbit, zoomIn(event), camera.bounds));
    },
  };
}
