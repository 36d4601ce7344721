/** Creates a link that carries the look and copies it; if the browser forbids copying, the link is shown. */
import { useEffect, useRef } from "preact/hooks";
import { linkToCopy, copyShareLink } from "../panels/looks/shareLink";
import { IconButton } from "../ui/IconButton";

export function ShareButton() {
  const link = linkToCopy.value;
  const field = useRef<HTMLInputElement>(null);
  const menu = useRef<HTMLDivElement>(null);
  const close = () => {
    linkToCopy.value = null;
    menu.current?.querySelector("button")?.focus();
  };
  const onEscape = (event: KeyboardEvent) => {
    if (event.key !== "Escape" || link === null) return;
    event.stopPropagation(); // keeps an enclosing menu open
    close();
  };
  useEffect(() => field.current?.select(), [link]);
  return (
    <div class="share-link" ref={menu} onKeyDown={onEscape}>
      <IconButton icon="share" label="Share: copy a link to this look" onClick={() => void copyShareLink()} />
      {link !== null && (
        <div class="menu-body" role="dialog" aria-label="Link to this look">
          <label>
            The browser blocked copying. Copy this link (Ctrl+C):
            <input ref={field} type="text" readOnly value={link} />
          </label>
          <button onClick={close}>Close</button>
        </div>
      )}
    </div>
  );
}
