"""The challenges as Gymnasium environments for one learner: rewards, goals as numbers, endings."""
