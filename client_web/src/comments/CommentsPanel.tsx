/** The comments on a scene, oldest first, and the one that is being written. */
import { useEffect, useRef, useState } from "preact/hooks";
import { MAX_COMMENT, type CommentBody } from "../protocol";
import { comments, listedComments, numberOf, openComments, pinning, resolvedShown, selectedComment } from "../state/comments";
import { mayComment, mayEdit, noCommentWords } from "../state/me";
import { togglePanel } from "../state/room";
import { IconButton } from "../ui/Button";
import { useReturnFocus } from "../ui/keepFocus";
import { beginComment, cancelComment, keepComment, pointOut, remove, settle } from "./comments";

const WHEN = new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle: "short" });

function Writing() {
  const [text, setText] = useState("");
  const field = useRef<HTMLTextAreaElement>(null);
  const pin = pinning.value;
  // a click that pins it elsewhere must not leave the words to the keys of the page; a pin moved by keys keeps the focus
  useEffect(() => {
    if (document.activeElement?.matches(".pin:focus-visible") !== true) field.current?.focus();
  }, [pin]);
  if (pin === null) return null;
  const keep = async () => {
    if (text.trim() !== "" && (await keepComment(text))) setText("");
  };
  const key = (event: KeyboardEvent) => {
    if (event.key === "Escape") cancelComment();
    else if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) void keep();
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <form
      class="comment-form"
      onKeyDown={key}
      onSubmit={(event) => {
        event.preventDefault();
        void keep();
      }}
    >
      <label>
        <span role="status">
          Comment on “{pin.view}” at {pin.x}, {pin.y}
        </span>
        <textarea
          ref={field}
          rows={4}
          maxLength={MAX_COMMENT}
          value={text}
          onInput={(event) => setText(event.currentTarget.value)}
        />
      </label>
      <p>Click in the picture to pin it elsewhere, or move its pin with the arrow keys.</p>
      <div class="group" role="group" aria-label="New comment">
        <button type="submit" disabled={text.trim() === ""} title="Keep it, with a picture of this moment (Ctrl+Enter)">
          Comment
        </button>
        <button type="button" title="Write nothing (Esc)" onClick={cancelComment}>
          Cancel
        </button>
      </div>
    </form>
  );
}

/** Where the pin is in the picture of the moment. */
function percent({ x, y, size: [width, height] }: CommentBody): { left: string; top: string } {
  return { left: `${(100 * (x + 0.5)) / width}%`, top: `${(100 * (y + 0.5)) / height}%` };
}

function Entry({ comment }: { comment: CommentBody }) {
  const { id, author, created, picture, resolved, resolved_by, text, view } = comment;
  const number = numberOf(id);
  const item = useRef<HTMLLIElement>(null);
  const isSelected = selectedComment.value === id;
  useEffect(() => {
    if (isSelected) item.current?.scrollIntoView({ block: "nearest" });
  }, [isSelected]);
  return (
    <li ref={item} class={`comment ${isSelected ? "selected" : ""} ${resolved ? "resolved" : ""}`}>
      <button class="comment-show" aria-label={`Show what comment ${number} is about`} onClick={() => pointOut(comment)}>
        {picture === null ? <span>{view}</span> : <img src={picture} alt="" loading="lazy" />}
        {picture !== null && <i class="comment-place" style={percent(comment)} aria-hidden="true" />}
      </button>
      <p class="comment-head">
        <b>{number}</b> <bdi>{author}</bdi> <time dateTime={created}>{WHEN.format(new Date(created))}</time>
      </p>
      <p class="comment-text" dir="auto">
        {text}
      </p>
      {resolved && <p class="quiet">Resolved by {resolved_by}</p>}
      {mayEdit.value && (
        <div class="group" role="group" aria-label={`Comment ${number}`}>
          <button onClick={() => void settle(comment, !resolved)}>{resolved ? "Open again" : "Resolve"}</button>
          <IconButton icon="trash" label={`Delete comment ${number}`} onClick={() => void remove(comment)} />
        </div>
      )}
    </li>
  );
}

export function CommentsPanel() {
  const panel = useRef<HTMLElement>(null);
  useReturnFocus(panel);
  const numResolved = comments.value.length - openComments.value.length;
  return (
    <aside ref={panel} class="comments beside-picture" aria-label="Comments">
      <header class="panel-head">
        <h2 class="spacer">Comments</h2>
        <IconButton icon="close" label="Close" onClick={() => togglePanel("comments")} />
      </header>
      {noCommentWords.value !== null && <p class="quiet">{noCommentWords.value}</p>}
      {mayComment.value && pinning.value === null && (
        <button title="Pin words to a pixel (N: where the pointer is)" onClick={beginComment}>
          New comment
        </button>
      )}
      {pinning.value !== null && <Writing />}
      {listedComments.value.length === 0 && <p class="quiet">{numResolved > 0 ? "All are resolved." : "Nobody has written any yet."}</p>}
      <ol aria-label="Comments, oldest first">
        {listedComments.value.map((comment) => (
          <Entry key={comment.id} comment={comment} />
        ))}
      </ol>
      {numResolved > 0 && (
        <label class="check">
          <input type="checkbox" checked={resolvedShown.value} onChange={() => (resolvedShown.value = !resolvedShown.value)} />
          Show {numResolved} resolved
        </label>
      )}
    </aside>
  );
}
