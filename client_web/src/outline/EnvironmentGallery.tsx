/** Small pictures of environments to choose from: the scene's own first, then built-in ones, then imported ones. */
import { useEffect, useRef } from "preact/hooks";
import { ownEnvironmentThumbnail } from "../net/api";
import { bake, look } from "../state/store";
import { IconButton } from "../ui/Button";
import { choose, environments, importing, loadEnvironments, take } from "./environments";

interface Entry {
  map: string | null;
  /** Room is small: the whole name is its tooltip. */
  name: string;
  title: string;
  picture: string;
}

function entriesOf(current: string): Entry[] {
  const own = { map: null, name: "Own", title: "The scene’s own", picture: ownEnvironmentThumbnail(current) };
  const others = environments.value.map(({ map, name, thumbnail }) => ({ map, name, title: name, picture: thumbnail }));
  return [own, ...others];
}

const STEPS: Record<string, number> = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

/** Arrow keys move along and choose, as in any group of radio buttons. */
function onArrow(event: KeyboardEvent, entries: readonly Entry[], chosen: number): void {
  const step = STEPS[event.key];
  if (step === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  event.stopPropagation();
  const next = (chosen + step + entries.length) % entries.length;
  (event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>("[role=radio]")[next]?.focus();
  choose((entries[next] as Entry).map);
}

function Choice({ entry, chosen, focusable }: { entry: Entry; chosen: boolean; focusable: boolean }) {
  return (
    <button
      type="button"
      role="radio"
      aria-checked={chosen}
      tabIndex={focusable ? 0 : -1}
      title={entry.title}
      onClick={() => choose(entry.map)}
    >
      <img src={entry.picture} alt="" width={64} height={32} />
      <span>{entry.name}</span>
    </button>
  );
}

export function ImportEnvironment() {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <input
        ref={input}
        class="unseen"
        type="file"
        tabIndex={-1}
        aria-label="Environment file"
        accept=".hdr,.exr"
        onChange={(event) => {
          const files = [...(event.currentTarget.files ?? [])];
          event.currentTarget.value = ""; // the same file may be chosen again
          if (files.length > 0) void take(files);
        }}
      />
      <IconButton
        icon="plus"
        label="Import an environment, .hdr or .exr; or drop one onto the picture"
        disabled={importing.value !== null}
        onClick={() => input.current?.click()}
      />
    </>
  );
}

export function EnvironmentGallery() {
  const current = bake.value;
  const map = look.value?.environment.map ?? null;
  useEffect(() => void loadEnvironments(), []);
  if (current === null) return null;
  const entries = entriesOf(current);
  const chosen = entries.findIndex((entry) => entry.map === map);
  return (
    <>
      <div
        class="environments"
        role="radiogroup"
        aria-label="Environment"
        onKeyDown={(event) => onArrow(event, entries, Math.max(0, chosen))}
      >
        {entries.map((entry, k) => (
          <Choice key={entry.map} entry={entry} chosen={k === chosen} focusable={k === Math.max(0, chosen)} />
        ))}
      </div>
      <div class="environment-words" role="status">
        {importing.value}
        {map !== null && <p>Shadows were baked before this light was known: those of small lamps are less exact.</p>}
      </div>
    </>
  );
}
