/** What hands do to the finder's picture: drag, slide, wheel, pinch, click and keys. */
import { useRef } from "preact/hooks";
import { Fingers } from "./fingers";
import { approached, panned, turned, type Bounds, type Orbit } from "./orbit";

type Pulled = PointerEvent & { readonly currentTarget: HTMLElement };
type Change = (by: (orbit: Orbit) => Orbit) => void;

export const TURN = Math.PI; // over the height of the picture
const WHEEL = 0.0015; // of the logarithm of the distance, for each pixel
const LINE_PX = 30;
const CLICK_PX = 4;
const KEY_TURN = Math.PI / 24;
const KEY_SLIDE = 0.05;
const KEY_NEARER = 0.9;

const ARROWS: Record<string, [across: number, down: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

/** A step as a key or a button makes it; false where the name is none's. */
export function step(change: Change, bounds: Bounds, key: string, slides: boolean): boolean {
  const arrow = ARROWS[key];
  if (arrow !== undefined) {
    const [across, down] = arrow;
    if (slides) change((orbit) => panned(orbit, -KEY_SLIDE * across, -KEY_SLIDE * down));
    else change((orbit) => turned(orbit, KEY_TURN * across, -KEY_TURN * down));
    return true;
  }
  if (key !== "+" && key !== "=" && key !== "-") return false;
  change((orbit) => approached(orbit, key === "-" ? 1 / KEY_NEARER : KEY_NEARER, bounds));
  return true;
}

/** How many times as far a camera is after a turn of the wheel. */
export const nearer = (event: WheelEvent): number =>
  Math.exp(WHEEL * event.deltaY * (event.deltaMode === 1 ? LINE_PX : 1));

/** Properties of the element that shows the picture. `click` gets fractions of its sides. */
export function useHand(change: Change, bounds: Bounds, click: (u: number, v: number) => void) {
  const fingers = useRef(new Fingers());
  const travelled = useRef(0);

  const move = (event: Pulled) => {
    const pull = fingers.current.move(event);
    if (pull === null) return;
    const { height } = event.currentTarget.getBoundingClientRect();
    const [across, down] = [pull.across / height, pull.down / height];
    travelled.current += Math.hypot(pull.across, pull.down) * pull.count;
    if (pull.count > 1 || event.shiftKey || (event.buttons & 6) !== 0) change((orbit) => panned(orbit, across, down));
    else change((orbit) => turned(orbit, -TURN * across, TURN * down));
    if (pull.count > 1) change((orbit) => approached(orbit, 1 / pull.spread, bounds));
  };
  const over = (event: Pulled) => {
    if (!fingers.current.lift(event) || event.type !== "pointerup") return;
    const box = event.currentTarget.getBoundingClientRect();
    if (fingers.current.count > 0 || event.button !== 0 || travelled.current > CLICK_PX) return;
    click((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  };
  return {
    onPointerDown(event: Pulled) {
      if (fingers.current.count === 0) travelled.current = 0;
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
      change((orbit) => approached(orbit, nearer(event), bounds));
    },
  };
}
