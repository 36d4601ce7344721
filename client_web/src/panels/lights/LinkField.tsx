/** Which surfaces a light lights, or which cast its shadows: all, only some, or all but some. */
import { useState } from "preact/hooks";
import { editValue } from "../../edit/edit";
import { hoveredMaterial } from "../../state/selection";
import { materialNames, objectNames } from "../../state/scene";
import { RadioRow, type RadioOption } from "../../ui/RadioRow";
import { linkOf, linkText, modeOf, namesOf, toggleName, type Link, type LinkMode, type SurfaceKind } from "./links";
import "./links.css";

const MODES: readonly RadioOption<LinkMode>[] = [
  { value: "all", label: "All", title: "All surfaces" },
  { value: "include", label: "Only", title: "Only the checked surfaces" },
  { value: "exclude", label: "All but", title: "All surfaces but the checked ones" },
];
/** Number of names from which a search field helps. */
const LONG_LIST = 12;

interface Props {
  label: string;
  /** Pointer of the link in the look. */
  path: string;
  link: Link;
}

function NameList({ label, path, link, kind, names }: Props & { kind: SurfaceKind; names: readonly string[] }) {
  if (names.length === 0) return null;
  const title = kind === "materials" ? "Materials" : "Objects";
  const checked = new Set(namesOf(link)[kind]);
  return (
    <fieldset class="linked-names">
      <legend>{title}</legend>
      {names.map((name) => (
        <label
          key={name}
          onPointerEnter={() => kind === "materials" && (hoveredMaterial.value = name)}
          onPointerLeave={() => (hoveredMaterial.value = null)}
        >
          <input
            type="checkbox"
            aria-label={`${label}: ${name}`}
            checked={checked.has(name)}
            onChange={() => editValue(`${label}: ${name}`, path, toggleName(link, kind, name))}
          />
          <span title={name}>{name}</span>
        </label>
      ))}
    </fieldset>
  );
}

export function LinkField({ label, path, link }: Props) {
  const [search, setSearch] = useState("");
  const mode = modeOf(link);
  const isLong = materialNames.value.length + objectNames.value.length > LONG_LIST;
  const matches = (name: string) => name.toLowerCase().includes(search.toLowerCase());
  const setMode = (next: LinkMode) => editValue(`${label}: ${next}`, path, linkOf(next, namesOf(link)));
  return (
    <div class="link-field" role="group" aria-label={label}>
      <span class="param-label" title={linkText(link)}>
        {label}
      </span>
      <RadioRow label={label} choices={MODES} selected={mode} onSelect={setMode} />
      {mode !== "all" && (
        <>
          {isLong && (
            <input
              type="search"
              placeholder="Find"
              aria-label={`${label}: find materials and objects`}
              value={search}
              onInput={(event) => setSearch(event.currentTarget.value)}
            />
          )}
          <div class="linked-lists">
            <NameList {...{ label, path, link }} kind="materials" names={materialNames.value.filter(matches)} />
            <NameList {...{ label, path, link }} kind="objects" names={objectNames.value.filter(matches)} />
          </div>
          <p class="hint" role="status">
            {linkText(link)}
          </p>
        </>
      )}
    </div>
  );
}
