/** A field for each import option. */
import { useId } from "preact/hooks";
import type { ImportOptions } from "../protocol";
import { IMPORT_OPTIONS } from "./importOptions";

interface ImportOptionsFormProps {
  options: ImportOptions;
  onChange: (options: ImportOptions) => void;
}

export function ImportOptionsForm({ options, onChange }: ImportOptionsFormProps) {
  const form = useId();
  return (
    <fieldset class="import-options">
      <legend>Import options</legend>
      {IMPORT_OPTIONS.map(({ key, label, help, choices }) => (
        <label key={key} for={`${form}-${key}`} title={help}>
          {label}
          <select
            id={`${form}-${key}`}
            value={options[key]}
            onChange={(event) => onChange({ ...options, [key]: event.currentTarget.value })}
          >
            {choices.map((choice) => (
              <option key={choice.value} value={choice.value}>
                {choice.label}
              </option>
            ))}
          </select>
        </label>
      ))}
    </fieldset>
  );
}
