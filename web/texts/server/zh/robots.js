// Chinese. What the server says when it refuses a robot's poses, files or conventions, as it says it; {} holds what changes, {2} names the second.

/** @type {Record<string, string>} */
export const texts = {
};
