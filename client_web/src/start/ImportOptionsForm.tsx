/** A field for each import option. */
import { useId } from "preact/hooks";
import type { ImportOptions } from "../protocol";
import { IMPORT_OPTIONS } from "./importOptions";

const MAX_TEXT = 200; // characters, the server's limit

interface ImportOptionsFormProps {
  options: ImportOptions;
  onChange: (options: ImportOptions) => void;
}

export function ImportOptionsForm({ options, onChange }: ImportOptionsFormProps) {
  const form = useId();
  const change = (key: keyof ImportOptions) => (event: { currentTarget: { value: string } }) =>
    onChange({ ...options, [key]: event.currentTarget.value });
  return (
    <fieldset class="import-options">
      <legend>Import options</legend>
      {IMPORT_OPTIONS.map(({ key, label, help, choices }) => (
        <label key={key} for={`${form}-${key}`} title={help}>
          {label}
          {choices.length > 0 ? (
            <select id={`${form}-${key}`} value={options[key]} onChange={change(key)}>
              {choices.map((choice) => (
                <option key={choice.value} value={choice.value}>
                  {choice.label}
                </option>
              ))}
            </select>
          ) : (
            <input
              id={`${form}-${key}`}
              value={options[key]}
              maxLength={MAX_TEXT}
              placeholder="As in file"
              onChange={change(key)}
            />
          )}
        </label>
      ))}
    </fieldset>
  );
}
