/** Over a view's image: a numbered pin per comment, and the pin of a new comment. */
import type { ImageCanvas } from "../../render/canvas";
import { toScreenPoint } from "../../render/zoomTransform";
import { transformOf } from "../../render/viewTransforms";
import { shownComments, commentNumber, pendingPin, selectedComment, type CommentPin } from "../../state/comments";
import { displayedFrames } from "../../state/display";
import { commentsOpen } from "../../state/panels";
import { isCameraAtComment, placePin, showComment } from "./commentActions";

const ARROW_STEPS: Record<string, [dx: number, dy: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};
const LARGE_STEP = 10;

/** CSS position of a pixel's center. */
function pinTransform(screen: ImageCanvas, { x, y, size: [width, height] }: CommentPin): { transform: string } {
  const { view } = screen.image;
  const [left, top] = toScreenPoint(transformOf(view), screen.size(), (x + 0.5) / width, (y + 0.5) / height);
  return { transform: `translate(${left.toFixed(1)}px, ${top.toFixed(1)}px)` };
}

/** The pin of a new comment. */
function NewPin({ screen, pin }: { screen: ImageCanvas; pin: CommentPin }) {
  const onKeyDown = (event: KeyboardEvent) => {
    const step = ARROW_STEPS[event.key];
    if (step === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    const stepSize = event.shiftKey ? LARGE_STEP : 1;
    placePin(pin.view, pin.x + stepSize * step[0], pin.y + stepSize * step[1]);
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <button
      class="pin new"
      style={pinTransform(screen, pin)}
      aria-roledescription="pin"
      aria-label={`Pin of the new comment, at ${pin.x}, ${pin.y}. Arrow keys move it, Shift by 10 pixels.`}
      title="Click in the picture or use arrow keys to move the pin"
      onKeyDown={onKeyDown}
    >
      <i aria-hidden="true">+</i>
    </button>
  );
}

export function CommentPins({ screen }: { screen: ImageCanvas }) {
  if (!commentsOpen.value) return null;
  void displayedFrames.value; // the canvas may have changed size
  const { view } = screen.image;
  const visibleComments = shownComments.value.filter((comment) => comment.view === view && isCameraAtComment(comment));
  const pin = pendingPin.value;
  return (
    <div class="pins">
      {visibleComments.map((comment) => (
        <button
          key={comment.id}
          class={`pin ${comment.resolved ? "resolved" : ""}`}
          style={pinTransform(screen, comment as CommentPin)}
          aria-pressed={selectedComment.value === comment.id}
          aria-label={`Comment ${commentNumber(comment.id)} by ${comment.author}`}
          title={comment.text}
          onClick={() => showComment(comment)}
        >
          <i aria-hidden="true">{commentNumber(comment.id)}</i>
        </button>
      ))}
      {pin?.view === view && <NewPin screen={screen} pin={pin} />}
    </div>
  );
}
