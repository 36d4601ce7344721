/** The comments on a scene, oldest first, and a new one. */
import { useEffect, useRef, useState } from "preact/hooks";
import { MAX_COMMENT, type CommentBody } from "../../protocol";
import {
  comments,
  shownComments,
  commentNumber,
  openComments,
  pendingPin,
  showResolved,
  selectedComment,
} from "../../state/comments";
import { mayComment, mayEdit, noCommentMessage } from "../../state/sessionUser";
import { togglePanel } from "../../state/panelWidths";
import { IconButton } from "../../ui/IconButton";
import { useReturnFocus } from "../../ui/restoreFocus";
import {
  beginComment,
  cancelComment,
  saveComment,
  showComment,
  deleteCommentWithUndo,
  setCommentResolved,
} from "./commentActions";
import { serverUrl } from "../../session/net/serverUrl";

const DATE_FORMAT = new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle: "short" });

function CommentForm() {
  const [text, setText] = useState("");
  const field = useRef<HTMLTextAreaElement>(null);
  const pin = pendingPin.value;
  // after a click moves the pin, typing must not trigger shortcuts; a pin moved by keys keeps the focus
  useEffect(() => {
    if (document.activeElement?.matches(".pin:focus-visible") !== true) field.current?.focus();
  }, [pin]);
  if (pin === null) return null;
  const submit = async () => {
    if (text.trim() !== "" && (await saveComment(text))) setText("");
  };
  const onKeyDown = (event: KeyboardEvent) => {
    if (event.key === "Escape") cancelComment();
    else if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) void submit();
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <form
      class="comment-form"
      onKeyDown={onKeyDown}
      onSubmit={(event) => {
        event.preventDefault();
        void submit();
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
      <p>Click in the picture to move the pin (or use arrow keys).</p>
      <div class="group" role="group" aria-label="New comment">
        <button type="submit" disabled={text.trim() === ""} title="Post with a snapshot of the picture (Ctrl+Enter)">
          Comment
        </button>
        <button type="button" title="Cancel (Esc)" onClick={cancelComment}>
          Cancel
        </button>
      </div>
    </form>
  );
}

/** CSS position of the pin in the snapshot. */
function pinPosition({ x, y, size: [width, height] }: CommentBody): { left: string; top: string } {
  return { left: `${(100 * (x + 0.5)) / width}%`, top: `${(100 * (y + 0.5)) / height}%` };
}

function CommentEntry({ comment }: { comment: CommentBody }) {
  const { id, author, created, picture: snapshot, resolved, resolved_by, text, view } = comment;
  const number = commentNumber(id);
  const item = useRef<HTMLLIElement>(null);
  const isSelected = selectedComment.value === id;
  useEffect(() => {
    if (isSelected) item.current?.scrollIntoView({ block: "nearest" });
  }, [isSelected]);
  return (
    <li ref={item} class={`comment ${isSelected ? "selected" : ""} ${resolved ? "resolved" : ""}`}>
      <button
        class="comment-show"
        aria-label={`Show comment ${number} in the picture`}
        onClick={() => showComment(comment)}
      >
        {snapshot === null ? <span>{view}</span> : <img src={serverUrl(snapshot)} alt="" loading="lazy" />}
        {snapshot !== null && <i class="comment-place" style={pinPosition(comment)} aria-hidden="true" />}
      </button>
      <p class="comment-head">
        <b>{number}</b> <bdi>{author}</bdi> <time dateTime={created}>{DATE_FORMAT.format(new Date(created))}</time>
      </p>
      <p class="comment-text" dir="auto">
        {text}
      </p>
      {resolved && <p class="quiet">Resolved by {resolved_by}</p>}
      {mayEdit.value && (
        <div class="group" role="group" aria-label={`Comment ${number}`}>
          <button onClick={() => void setCommentResolved(comment, !resolved)}>{resolved ? "Reopen" : "Resolve"}</button>
          <IconButton
            icon="trash"
            label={`Delete comment ${number}`}
            onClick={() => void deleteCommentWithUndo(comment)}
          />
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
      {noCommentMessage.value !== null && <p class="quiet">{noCommentMessage.value}</p>}
      {mayComment.value && pendingPin.value === null && (
        <button title="Pin a comment to a pixel (N: at the pointer)" onClick={beginComment}>
          New comment
        </button>
      )}
      {pendingPin.value !== null && <CommentForm />}
      {shownComments.value.length === 0 && (
        <p class="quiet">{numResolved > 0 ? "All comments are resolved." : "No comments yet."}</p>
      )}
      <ol aria-label="Comments, oldest first">
        {shownComments.value.map((comment) => (
          <CommentEntry key={comment.id} comment={comment} />
        ))}
      </ol>
      {numResolved > 0 && (
        <label class="check">
          <input
            type="checkbox"
            checked={showResolved.value}
            onChange={() => (showResolved.value = !showResolved.value)}
          />
          Show {numResolved} resolved
        </label>
      )}
    </aside>
  );
}
