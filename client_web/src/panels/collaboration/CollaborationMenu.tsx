/** The members of the room as dots and names in the top bar; the menu has the list and the links. */
import { useEffect, useRef, useState } from "preact/hooks";
import { MAX_PERSON_NAME, type Person } from "../../protocol";
import { sessionUser, mayEdit } from "../../state/sessionUser";
import { joinState, ownName, members, isWatching, selfNumber } from "../../state/collaboration";
import { IconButton } from "../../ui/IconButton";
import { showNote } from "../../ui/toasts";
import { useDismiss } from "../../ui/useDismiss";
import { startRoom, leaveRoom, createRoomLink } from "./memberPresence";

const MAX_CHIPS = 3;

/** A member's status as text. */
export function memberStatus({ online: isOnline, role, material }: Person): string {
  if (!isOnline) return "connection lost";
  if (role === "view") return "viewing";
  return material === null ? "idle" : `editing ${material}`;
}

function MemberDot({ person }: { person: Person }) {
  return <i class={`dot ${person.online ? "" : "away"}`} style={{ "--person": person.color }} aria-hidden="true" />;
}

function MemberChips() {
  const otherMembers = members.value.filter(({ id }) => id !== selfNumber.value);
  if (otherMembers.length === 0) return <span class="alone">Waiting for others</span>;
  return (
    <>
      {otherMembers.slice(0, MAX_CHIPS).map((person) => (
        <span key={person.id} class="chip" title={`${person.name}: ${memberStatus(person)}`}>
          <MemberDot person={person} />
          <span class="who">{person.name}</span>
          {person.material !== null && <small>{person.material}</small>}
        </span>
      ))}
      {otherMembers.length > MAX_CHIPS && <small>+{otherMembers.length - MAX_CHIPS}</small>}
    </>
  );
}

function MemberList() {
  return (
    <ul class="people" aria-label="Session members">
      {members.value.map((person) => (
        <li key={person.id}>
          <MemberDot person={person} />
          <span class="who">{person.name}</span>
          <span class="status-text">
            {person.id === selfNumber.value && "you, "}
            {memberStatus(person)}
          </span>
        </li>
      ))}
    </ul>
  );
}

function OwnNameField() {
  if (sessionUser.value.name !== "" || selfNumber.value === null) return null;
  return (
    <label class="own-name">
      Your name
      <input
        type="text"
        maxLength={MAX_PERSON_NAME}
        value={ownName.value || members.value.find(({ id }) => id === selfNumber.value)?.name}
        onChange={(event) => (ownName.value = event.currentTarget.value.trim())}
      />
    </label>
  );
}

/** Links into the room. If the browser blocks copying, the link is shown. */
function RoomLinks() {
  const [visibleLink, setVisibleLink] = useState<string | null>(null);
  const field = useRef<HTMLInputElement>(null);
  useEffect(() => field.current?.select(), [visibleLink]);
  const copy = async (kind: "edit" | "watch") => {
    const link = await createRoomLink(kind);
    if (link === null) return;
    try {
      await navigator.clipboard.writeText(link);
      showNote(
        kind === "edit"
          ? "Link copied. Anyone with this link can edit."
          : "Link copied. Anyone with this link can watch.",
      );
    } catch {
      setVisibleLink(link);
    }
  };
  return (
    <>
      <button onClick={() => void copy("edit")}>Copy edit link</button>
      <button disabled={joinState.value?.watch == null} onClick={() => void copy("watch")}>
        Copy view-only link
      </button>
      {visibleLink !== null && (
        <label>
          The browser blocked copying. Copy this link (Ctrl+C):
          <input ref={field} type="text" readOnly value={visibleLink} />
        </label>
      )}
    </>
  );
}

function CollaborationBody() {
  if (joinState.value === null) {
    return (
      <>
        <p>Edit this look together, live. Everyone keeps their own camera and exposure.</p>
        <button onClick={startRoom}>Start live session</button>
      </>
    );
  }
  return (
    <>
      <MemberList />
      <OwnNameField />
      {mayEdit.value && <RoomLinks />}
      {!isWatching.value && <button onClick={leaveRoom}>Leave session</button>}
    </>
  );
}

export function CollaborationMenu() {
  const [open, setOpen] = useState(false);
  const menu = useRef<HTMLDivElement>(null);
  useDismiss(open, menu, () => setOpen(false));
  if (joinState.value === null && !mayEdit.value) return null;
  const escape = (event: KeyboardEvent) => {
    if (event.key !== "Escape" || !open) return;
    setOpen(false);
    menu.current?.querySelector("button")?.focus();
  };
  const toggle = () => setOpen(!open);
  return (
    <div class="together" ref={menu} onKeyDown={escape}>
      {joinState.value === null ? (
        <IconButton icon="people" label="Work together" expanded={open} onClick={toggle} />
      ) : (
        <button
          class="chips"
          aria-label={`Work together: ${members.value.length} online`}
          aria-expanded={open}
          onClick={toggle}
        >
          <MemberChips />
        </button>
      )}
      {open && (
        <div class="menu-body" role="dialog" aria-label="Work together">
          <CollaborationBody />
        </div>
      )}
    </div>
  );
}
