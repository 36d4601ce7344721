/** A row of buttons with one selected, by click or arrow keys. */
import { onRadioKey } from "./radio";

export interface RadioOption<T> {
  value: T;
  label: string;
  title: string;
}

interface Props<T> {
  label: string;
  choices: readonly RadioOption<T>[];
  selected: T;
  onSelect: (value: T) => void;
}

export function RadioRow<T extends string>({ label, choices, selected, onSelect }: Props<T>) {
  const selectedIndex = choices.findIndex(({ value }) => value === selected);
  const chooseAt = (index: number) => {
    const choice = choices[index];
    if (choice !== undefined) onSelect(choice.value);
  };
  return (
    <div
      class="group segmented"
      role="radiogroup"
      aria-label={label}
      onKeyDown={(event) => onRadioKey(event, choices.length, selectedIndex, chooseAt)}
    >
      {choices.map(({ value, label, title }, index) => (
        <button
          key={value}
          role="radio"
          aria-checked={index === selectedIndex}
          tabIndex={index === selectedIndex ? 0 : -1}
          title={title}
          onClick={() => onSelect(value)}
        >
          {label}
        </button>
      ))}
    </div>
  );
}
