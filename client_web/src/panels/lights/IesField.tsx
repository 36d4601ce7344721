/** The IES file of a point or a spot: choose, upload, delete, and a plot of it. */
import { useEffect, useRef } from "preact/hooks";
import { IconButton } from "../../ui/IconButton";
import {
  assignIes,
  iesFiles,
  iesOf,
  iesUploadProgress,
  loadIesFiles,
  offerToDeleteIes,
  removeIes,
  uploadAndAssignIes,
} from "./iesFiles";
import { PolarPlot } from "./PolarPlot";
import "./ies.css";

export function IesField({ name, profile }: { name: string; profile: string | null }) {
  const file = useRef<HTMLInputElement>(null);
  useEffect(() => void loadIesFiles(), [profile]); // it may have been uploaded elsewhere
  const ies = profile === null ? undefined : iesOf(profile);
  const choose = (value: string) => {
    const chosen = iesOf(value);
    if (chosen === undefined) removeIes(name);
    else assignIes(name, chosen);
  };
  return (
    <div class="ies-field" role="group" aria-label="IES">
      <span class="param-label">IES</span>
      <div class="base-image-row">
        <select
          aria-label="IES file"
          title="Intensity over directions, measured from a luminaire"
          value={profile ?? ""}
          onChange={(event) => choose(event.currentTarget.value)}
        >
          <option value="">None</option>
          {profile !== null && ies === undefined && (
            <option value={profile}>{iesFiles.value === null ? "Loading…" : "Missing file"}</option>
          )}
          {(iesFiles.value ?? []).map((each) => (
            <option key={each.id} value={each.profile}>
              {each.name}
            </option>
          ))}
        </select>
        <button
          type="button"
          title="Load IES file…"
          disabled={iesUploadProgress.value !== null}
          onClick={() => file.current?.click()}
        >
          Load…
        </button>
        <input
          ref={file}
          type="file"
          hidden
          accept=".ies"
          aria-label="Load IES file…"
          onChange={(event) => {
            const selectedFile = event.currentTarget.files?.[0];
            event.currentTarget.value = "";
            if (selectedFile !== undefined) void uploadAndAssignIes(name, selectedFile);
          }}
        />
        {ies !== undefined && (
          <IconButton icon="trash" label={`Delete ${ies.name}`} onClick={() => offerToDeleteIes(name, ies)} />
        )}
      </div>
      {iesUploadProgress.value !== null && (
        <p class="hint" role="status">
          {iesUploadProgress.value}
        </p>
      )}
      {ies !== undefined && <PolarPlot planes={ies.planes} candela={ies.candela} />}
    </div>
  );
}
