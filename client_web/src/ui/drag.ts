/** Common dragging: captures the pointer, prevents native drag and drop of text and images, and ends however the
 * pointer is lost. */
import { useEffect, useRef } from "preact/hooks";
import { history } from "../edit/history";

type DragTarget = PointerEvent & { readonly currentTarget: Element };

interface DragHandlers {
  /** The pointer went down; return false to ignore it. */
  begin: ((event: DragTarget) => boolean) | ((event: DragTarget) => void);
  /** It moved while pressed. */
  move?: (event: DragTarget) => void;
  /** It moved while not pressed. */
  hover?: (event: DragTarget) => void;
  /** The drag ended; `released`: the pointer was released, not lost. */
  end?: (event: DragTarget, released: boolean) => void;
}

/** Prevents native dragging of selected text or images, which would cancel the pointer. */
function preventDefault(event: Event): void {
  event.preventDefault();
}

function listenForDragStart(listen: boolean): void {
  if (listen) window.addEventListener("dragstart", preventDefault, { capture: true });
  else window.removeEventListener("dragstart", preventDefault, { capture: true });
}

/** Event handlers of a draggable element. */
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
      if (activePointer.current !== null) listenForDragStart(false); // the element was removed during the drag
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
      // released without an event, as outside the window
      if (activePointer.current !== null && (event.buttons & activePointer.current.buttons) === 0) lost(event);
      if (activePointer.current === null) hover?.(event);
      else if (activePointer.current.pointer === event.pointerId) move?.(event);
    },
    onPointerUp: (event: DragTarget) => over(event, true),
    onPointerCancel: lost,
    onLostPointerCapture: lost,
  };
}
