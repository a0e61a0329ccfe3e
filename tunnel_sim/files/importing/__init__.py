"""Import of records as instruments write them: from files of many formats to a campaign."""
