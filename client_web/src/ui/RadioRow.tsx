/** Buttons side by side of which one is chosen, by click or by arrow keys. */
import { onRadioKey } from "./radio";

export interface Choice<T> {
  value: T;
  label: string;
  title: string;
}

interface Props<T> {
  label: string;
  choices: readonly Choice<T>[];
  chosen: T;
  onChoose(value: T): void;
}

export function RadioRow<T extends string>({ label, choices, chosen, onChoose }: Props<T>) {
  const at = choices.findIndex(({ value }) => value === chosen);
  const chooseAt = (index: number) => {
    const choice = choices[index];
    if (choice !== undefined) onChoose(choice.value);
  };
  return (
    <div
      class="group segmented"
      role="radiogroup"
      aria-label={label}
      onKeyDown={(event) => onRadioKey(event, choices.length, at, chooseAt)}
    >
      {choices.map(({ value, label, title }, index) => (
        <button
          key={value}
          role="radio"
          aria-checked={index === at}
          tabIndex={index === at ? 0 : -1}
          title={title}
          onClick={() => onChoose(value)}
        >
          {label}
        </button>
      ))}
    </div>
  );
}
