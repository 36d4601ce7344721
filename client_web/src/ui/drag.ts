/** Dragging, the same everywhere: the pointer is captured, the browser's own dragging of text and images stays away,
 * and however the pointer is lost, the drag ends. */
import { useEffect, useRef } from "preact/hooks";
import { history } from "../edit/history";

type DragTarget = PointerEvent & { readonly currentTarget: Element };

interface DragHandlers {
  /** The pointer went down; false where it takes hold of nothing. */
  begin(event: DragTarget): boolean | void;
  /** It moved while it was held. */
  move?(event: DragTarget): void;
  /** It moved while it was not held. */
  hover?(event: DragTarget): void;
  /** The drag is over; `released` if the pointer was released, not if it was lost. */
  end?(event: DragTarget, released: boolean): void;
}

/** Selected text, or an image that a moved border uncovers, would be dragged in the thumb's place: the browser then takes
 * the pointer away. */
function preventDefault(event: Event): void {
  event.preventDefault();
}

function listenForDragStart(listen: boolean): void {
  if (listen) window.addEventListener("dragstart", preventDefault, { capture: true });
  else window.removeEventListener("dragstart", preventDefault, { capture: true });
}

/** Properties of an element that is dragged. */
export function useDrag({ begin, move, hover, end }: DragHandlers) {
  const activePointer = useRef<{ pointer: number; buttons: number } | null>(null);
  const over = (event: DragTarget, released: boolean) => {
    if (activePointer.current?.pointer !== event.pointerId) return;
    activePointer.current = null;
    listenForDragStart(false);
    end?.(event, released);
    history.endGesture();
  };
  useEffect(
    () => () => {
      if (activePointer.current !== null) listenForDragStart(false); // it was removed during the drag
    },
    [],
  );
  const lost = (event: DragTarget) => over(event, false);
  return {
    "data-drag": "",
    onPointerDown(event: DragTarget) {
      lost(event);
      if (activePointer.current !== null || begin(event) === false) return;
      activePointer.current = { pointer: event.pointerId, buttons: event.buttons };
      listenForDragStart(true);
      event.currentTarget.setPointerCapture(event.pointerId);
    },
    onPointerMove(event: DragTarget) {
      // released without an event, such as outside the window
      if (activePointer.current !== null && (event.buttons & activePointer.current.buttons) === 0) lost(event);
      if (activePointer.current === null) hover?.(event);
      else if (activePointer.current.pointer === event.pointerId) move?.(event);
    },
    onPointerUp: (event: DragTarget) => over(event, true),
    onPointerCancel: lost,
    onLostPointerCapture: lost,
  };
}
