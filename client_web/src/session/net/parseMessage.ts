/** Parses a live session's socket data: texts are messages, everything else is a binary frame. */
import type { ServerMessage } from "../../protocol";

/** Handlers by message type. */
export type MessageHandlers = {
  [Message in ServerMessage as Message["type"]]: (message: Message) => void;
};

export class MessageError extends Error {}

/** Dispatch a message to the handler of its type; unknown types are ignored. Throws MessageError if the text is not a
 * message. */
export function dispatchMessage(text: string, handlers: MessageHandlers): void {
  let message: ServerMessage | null;
  try {
    message = JSON.parse(text) as ServerMessage | null;
  } catch {
    throw new MessageError("the server sent a message that is not JSON");
  }
  const type = message?.type;
  if (type === undefined) throw new MessageError("the server sent a message without a type");
  if (Object.hasOwn(handlers, type)) (handlers[type] as (message: ServerMessage) => void)(message as ServerMessage);
}
