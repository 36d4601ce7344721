/** Small pictures of environments to choose from: the scene's own first, then built-in ones, then imported ones. */
import { useEffect, useRef } from "preact/hooks";
import { ownEnvironmentThumbnail } from "../net/api";
import { bake } from "../state/bakes";
import { look } from "../state/look";
import { IconButton } from "../ui/Button";
import { onRadioKey } from "../ui/radio";
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
  const focusable = Math.max(0, chosen);
  return (
    <>
      <div
        class="environments"
        role="radiogroup"
        aria-label="Environment"
        onKeyDown={(event) =>
          onRadioKey(event, entries.length, focusable, (index) => choose((entries[index] as Entry).map))
        }
      >
        {entries.map((entry, k) => (
          <Choice key={entry.map} entry={entry} chosen={k === chosen} focusable={k === focusable} />
        ))}
      </div>
      <div class="environment-words" role="status">
        {importing.value}
        {map !== null && <p>Shadows were baked before this light was known: those of small lamps are approximate.</p>}
      </div>
    </>
  );
}
