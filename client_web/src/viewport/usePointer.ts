/** The pointer's and fingers' ways to move in a picture, or to move its eye. */
import { useRef } from "preact/hooks";
import { eyeOf } from "../cameras/eye";
import { Fingers, type Pull } from "../cameras/fingers";
import { approached, panned, turned } from "../cameras/orbit";
import { TURN } from "../cameras/useHand";
import { pinAt } from "../comments/comments";
import { placeAt, placing } from "../lights/placing";
import { askProbe } from "../live/probing";
import { hitAt } from "../picture/hit";
import type { Screen } from "../picture/screen";
import { pan, zoomAt } from "../picture/transform";
import { moveTo, transformOf } from "../picture/viewTransforms";
import { pinning } from "../state/comments";
import { hoveredMaterial, select } from "../state/selection";
import { pointedView } from "../state/views";
import { useDrag } from "../ui/drag";
import { leavePicture, probeAt } from "./probe";

type Pulled = PointerEvent & { readonly currentTarget: Element };

const CLICK_PX = 4;

export function panBy(screen: Screen, dx: number, dy: number): void {
  const { view } = screen.picture;
  moveTo(view, pan(transformOf(view), screen.size(), dx, dy));
}

/** Select what a pixel shows: where the eye moves, the server knows. */
async function selectAt(view: string, x: number, y: number): Promise<void> {
  const { material } = await askProbe(view, x, y);
  if (material !== null) select(material);
}

/** Two fingers slide what they hold, and spread it. */
function pinch(screen: Screen, view: string, { across, down, middle, spread }: Pull): void {
  const eye = eyeOf(view);
  if (eye === null) {
    const box = screen.canvas.getBoundingClientRect();
    panBy(screen, across, down);
    return moveTo(view, zoomAt(transformOf(view), screen.size(), spread, middle.x - box.left, middle.y - box.top));
  }
  leavePicture();
  const { height } = screen.size();
  eye.change((orbit) => approached(panned(orbit, across / height, down / height), 1 / spread, eye.bounds));
}

export function usePointer(screen: Screen | null, view: string) {
  const drag = useRef({ x: 0, y: 0, moved: false });
  const begin = (event: PointerEvent) => {
    drag.current = { x: event.clientX, y: event.clientY, moved: false };
    const eye = eyeOf(view);
    void eye?.grasp();
    return event.button <= (eye === null ? 1 : 2);
  };
  const move = (event: PointerEvent) => {
    if (screen === null) return;
    pointedView.value = view;
    const { x, y, moved } = drag.current;
    const [dx, dy] = [event.clientX - x, event.clientY - y];
    if (!moved && Math.hypot(dx, dy) < CLICK_PX) return;
    drag.current = { x: event.clientX, y: event.clientY, moved: true };
    const eye = eyeOf(view);
    if (eye === null) return panBy(screen, dx, dy);
    leavePicture(); // what was probed has moved away from the pointer
    const { height } = screen.size();
    if (event.shiftKey || (event.buttons & 6) !== 0) eye.change((orbit) => panned(orbit, dx / height, dy / height));
    else eye.change((orbit) => turned(orbit, (-TURN * dx) / height, (TURN * dy) / height));
  };
  const hover = (event: PointerEvent) => {
    if (screen === null) return;
    pointedView.value = view; // not when it enters: the view under a resting pointer may become another
    const { px, py, material } = hitAt(screen, event);
    probeAt(screen.picture, px, py);
    hoveredMaterial.value = material;
  };
  const end = (event: PointerEvent, released: boolean) => {
    if (screen === null || !released || drag.current.moved || event.button !== 0) return;
    const { px, py, material } = hitAt(screen, event);
    if (placing.peek() !== null) void placeAt(view, px, py);
    else if (pinning.peek() !== null) pinAt(view, px, py);
    else if (eyeOf(view) !== null) void selectAt(view, px, py);
    else if (material !== null) select(material);
  };
  const leave = () => {
    pointedView.value = hoveredMaterial.value = null;
    leavePicture();
  };
  const one = useDrag({ begin, move, hover, end });
  const fingers = useRef(new Fingers());
  const lift = (event: PointerEvent) => {
    const { current } = fingers;
    const left = current.lift(event) ? current.only : null;
    if (left !== null) drag.current = { ...left, moved: true }; // it goes on from where it is
  };
  return {
    ...one,
    onPointerLeave: leave,
    onPointerDown(event: Pulled) {
      if (event.pointerType === "touch") fingers.current.press(event);
      one.onPointerDown(event);
    },
    onPointerMove(event: Pulled) {
      const pull = fingers.current.move(event);
      if (screen === null || pull === null || pull.count < 2) return one.onPointerMove(event);
      drag.current.moved = true; // no click
      return pinch(screen, view, pull);
    },
    onPointerUp: (event: Pulled) => (lift(event), one.onPointerUp(event)),
    onPointerCancel: (event: Pulled) => (lift(event), one.onPointerCancel(event)),
  };
}
