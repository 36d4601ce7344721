/** Over a view's picture: a numbered pin for each comment on it, and the one that is being placed. */
import type { Screen } from "../picture/screen";
import { toScreen } from "../picture/transform";
import { transformOf } from "../picture/viewTransforms";
import { listedComments, numberOf, pinning, selectedComment, type Pin } from "../state/comments";
import { drawn } from "../state/display";
import { commentsOpen } from "../state/panels";
import { isSeenFrom, pinAt, pointOut } from "./comments";

const STEPS: Record<string, [dx: number, dy: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};
const LARGE = 10;

/** Where the middle of a pixel lies on the screen. */
function placeOf(screen: Screen, { x, y, size: [width, height] }: Pin): { transform: string } {
  const { view } = screen.picture;
  const [left, top] = toScreen(transformOf(view), screen.size(), (x + 0.5) / width, (y + 0.5) / height);
  return { transform: `translate(${left.toFixed(1)}px, ${top.toFixed(1)}px)` };
}

/** The pin of the comment that is being written. */
function NewPin({ screen, pin }: { screen: Screen; pin: Pin }) {
  const key = (event: KeyboardEvent) => {
    const step = STEPS[event.key];
    if (step === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    const by = event.shiftKey ? LARGE : 1;
    pinAt(pin.view, pin.x + by * step[0], pin.y + by * step[1]);
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <button
      class="pin new"
      style={placeOf(screen, pin)}
      aria-roledescription="pin"
      aria-label={`Pin of the new comment, at ${pin.x}, ${pin.y}. Arrow keys move it, with Shift by ten.`}
      title="Click in the picture, or move it with the arrow keys"
      onKeyDown={key}
    >
      <i aria-hidden="true">+</i>
    </button>
  );
}

export function Pins({ screen }: { screen: Screen }) {
  if (!commentsOpen.value) return null;
  drawn.value; // the canvas may have another size
  const { view } = screen.picture;
  const shown = listedComments.value.filter((comment) => comment.view === view && isSeenFrom(comment));
  const pin = pinning.value;
  return (
    <div class="pins">
      {shown.map((comment) => (
        <button
          key={comment.id}
          class={`pin ${comment.resolved ? "resolved" : ""}`}
          style={placeOf(screen, comment as Pin)}
          aria-pressed={selectedComment.value === comment.id}
          aria-label={`Comment ${numberOf(comment.id)} by ${comment.author}`}
          title={comment.text}
          onClick={() => pointOut(comment)}
        >
          <i aria-hidden="true">{numberOf(comment.id)}</i>
        </button>
      ))}
      {pin?.view === view && <NewPin screen={screen} pin={pin} />}
    </div>
  );
}
