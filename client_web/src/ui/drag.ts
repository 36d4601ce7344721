/** Dragging, the same everywhere: the pointer is captured, the browser's own dragging of text and pictures stays away,
 * and however the pointer is lost, the drag ends. */
import { useEffect, useRef } from "preact/hooks";
import { history } from "../edit/history";

type Pulled = PointerEvent & { readonly currentTarget: Element };

interface Drag {
  /** The pointer went down; false where it takes hold of nothing. */
  begin(event: Pulled): boolean | void;
  /** It moved while it was held. */
  move?(event: Pulled): void;
  /** It moved while it was not held. */
  hover?(event: Pulled): void;
  /** The drag is over; `released` where the hand let go, not where the pointer was lost. */
  end?(event: Pulled, released: boolean): void;
}

/** Selected text, or a picture that a moved border uncovers, would be dragged in the thumb's place: the browser then takes
 * the pointer away. */
function refuse(event: Event): void {
  event.preventDefault();
}

function hearDragStart(listen: boolean): void {
  if (listen) window.addEventListener("dragstart", refuse, { capture: true });
  else window.removeEventListener("dragstart", refuse, { capture: true });
}

/** Properties of an element that is dragged. */
export function useDrag({ begin, move, hover, end }: Drag) {
  const held = useRef<{ pointer: number; buttons: number } | null>(null);
  const over = (event: Pulled, released: boolean) => {
    if (held.current?.pointer !== event.pointerId) return;
    held.current = null;
    hearDragStart(false);
    end?.(event, released);
    history.seal();
  };
  useEffect(
    () => () => {
      if (held.current !== null) hearDragStart(false); // it has gone from under the hand
    },
    [],
  );
  const lost = (event: Pulled) => over(event, false);
  return {
    "data-drag": "",
    onPointerDown(event: Pulled) {
      lost(event);
      if (held.current !== null || begin(event) === false) return;
      held.current = { pointer: event.pointerId, buttons: event.buttons };
      hearDragStart(true);
      event.currentTarget.setPointerCapture(event.pointerId);
    },
    onPointerMove(event: Pulled) {
      // released where nobody told us, such as outside the window
      if (held.current !== null && (event.buttons & held.current.buttons) === 0) lost(event);
      if (held.current === null) hover?.(event);
      else if (held.current.pointer === event.pointerId) move?.(event);
    },
    onPointerUp: (event: Pulled) => over(event, true),
    onPointerCancel: lost,
    onLostPointerCapture: lost,
  };
}
