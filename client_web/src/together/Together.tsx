/** Who works on this look: a dot and a name for each in the top bar; behind them the list in words, and the links. */
import { useEffect, useRef, useState } from "preact/hooks";
import { MAX_PERSON_NAME, type Person } from "../protocol";
import { me, mayEdit } from "../state/me";
import { door, ownName, people, watching, you } from "../state/together";
import { IconButton } from "../ui/Button";
import { note } from "../ui/toasts";
import { useClosing } from "../ui/useClosing";
import { begin, leaveRoom, linkInto } from "./together";

const MOST_SHOWN = 3;

/** What somebody does, in words. */
export function statusOf({ here, role, material }: Person): string {
  if (!here) return "connection lost";
  if (role === "view") return "watches";
  return material === null ? "nothing in hand" : `has ${material} in hand`;
}

function Dot({ person }: { person: Person }) {
  return <i class={`dot ${person.here ? "" : "away"}`} style={{ "--person": person.color }} aria-hidden="true" />;
}

function Chips() {
  const others = people.value.filter(({ number }) => number !== you.value);
  if (others.length === 0) return <span class="alone">Nobody else yet</span>;
  return (
    <>
      {others.slice(0, MOST_SHOWN).map((person) => (
        <span key={person.number} class="chip" title={`${person.name}: ${statusOf(person)}`}>
          <Dot person={person} />
          <span class="who">{person.name}</span>
          {person.material !== null && <small>{person.material}</small>}
        </span>
      ))}
      {others.length > MOST_SHOWN && <small>+{others.length - MOST_SHOWN}</small>}
    </>
  );
}

function List() {
  return (
    <ul class="people" aria-label="People who share this look">
      {people.value.map((person) => (
        <li key={person.number}>
          <Dot person={person} />
          <span class="who">{person.name}</span>
          <span class="status-words">
            {person.number === you.value && "you, "}
            {statusOf(person)}
          </span>
        </li>
      ))}
    </ul>
  );
}

function Name() {
  if (me.value.name !== "" || you.value === null) return null;
  return (
    <label class="own-name">
      Your name
      <input
        type="text"
        maxLength={MAX_PERSON_NAME}
        value={ownName.value || people.value.find(({ number }) => number === you.value)?.name}
        onChange={(event) => (ownName.value = event.currentTarget.value.trim())}
      />
    </label>
  );
}

/** A link that the browser did not let us copy is shown to be copied by hand. */
function Links() {
  const [shown, setShown] = useState<string | null>(null);
  const field = useRef<HTMLInputElement>(null);
  useEffect(() => field.current?.select(), [shown]);
  const copy = async (kind: "edit" | "watch") => {
    const link = await linkInto(kind);
    if (link === null) return;
    try {
      await navigator.clipboard.writeText(link);
      note(kind === "edit" ? "The link is copied. Who opens it edits with you." : "The link is copied. Who opens it watches.");
    } catch {
      setShown(link);
    }
  };
  return (
    <>
      <button onClick={() => void copy("edit")}>Copy link: work together</button>
      <button disabled={door.value?.watch == null} onClick={() => void copy("watch")}>
        Copy link: watch only
      </button>
      {shown !== null && (
        <label>
          This browser does not let the editor copy. Copy the link yourself (Ctrl+C):
          <input ref={field} type="text" readOnly value={shown} />
        </label>
      )}
    </>
  );
}

function Body() {
  if (door.value === null) {
    return (
      <>
        <p>Others see this look change as you edit it, and edit it with you, each from their own eye and in their own exposure.</p>
        <button onClick={begin}>Share this look live</button>
      </>
    );
  }
  return (
    <>
      <List />
      <Name />
      {mayEdit.value && <Links />}
      {!watching.value && <button onClick={leaveRoom}>Go on alone</button>}
    </>
  );
}

export function Together() {
  const [open, setOpen] = useState(false);
  const menu = useRef<HTMLDivElement>(null);
  useClosing(open, menu, () => setOpen(false));
  if (door.value === null && !mayEdit.value) return null;
  const escape = (event: KeyboardEvent) => {
    if (event.key !== "Escape" || !open) return;
    setOpen(false);
    menu.current?.querySelector("button")?.focus();
  };
  const toggle = () => setOpen(!open);
  return (
    <div class="together" ref={menu} onKeyDown={escape}>
      {door.value === null ? (
        <IconButton icon="people" label="Work together" expanded={open} onClick={toggle} />
      ) : (
        <button class="chips" aria-label={`Work together: ${people.value.length} here`} aria-expanded={open} onClick={toggle}>
          <Chips />
        </button>
      )}
      {open && (
        <div class="menu-body" role="dialog" aria-label="Work together">
          <Body />
        </div>
      )}
    </div>
  );
}
